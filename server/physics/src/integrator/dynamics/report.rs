//! What a step says about itself.

use std::fmt;

use nalgebra::Vector3;

use super::Scheme;
use crate::integrator::FreeMotion;
use crate::solver::NewtonReport;

/// How a step of [`Dynamics`](super::Dynamics) went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DynamicsReport {
    /// What became of the step.
    pub outcome: DynamicsOutcome,
    /// The scheme that made it; another than the chosen one where a guard stepped in.
    pub scheme: Scheme,
    /// What the user should know, if anything.
    pub notice: Option<Notice>,
    /// Newton's method, last solve; linear iterations are those of the whole step. With
    /// [`linearised`](super::DynamicsSettings::linearised) `residual` is that of the linear solve.
    pub newton: NewtonReport,
    /// Into how many equal parts an explicit step was divided; 1 for implicit schemes.
    pub substeps: u32,
    /// Longest stable step [s] of an explicit scheme, as last computed.
    pub stable_step_s: Option<f64>,
    /// Quadrature points with det F ≤ 0 at the start of the step.
    pub inverted: usize,
    /// Springs that were left out because a number in them is not usable.
    pub refused_springs: usize,
    /// Kinetic energy at the end [J].
    pub kinetic_j: f64,
    /// Elastic energy at the end [J]; explicit schemes do not need it and leave it out.
    pub elastic_j: Option<f64>,
}

/// What became of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DynamicsOutcome {
    /// The body advanced by the whole step.
    #[default]
    Advanced,
    /// Nothing stayed finite: the body is where it was, and at rest.
    Held,
    /// The step cannot be made as asked; nothing was changed.
    Refused,
    /// The stop flag was raised; the body is as it was.
    Interrupted,
}

/// Something that a step did differently from what was asked for, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Notice {
    /// h, gravity, a load or β, γ is not usable.
    BadInput,
    /// h is longer than what the explicit scheme can bear, and so many sub-steps were not allowed.
    TooLong {
        /// The step asked for [s].
        h_s: f64,
        /// Longest stable step [s].
        stable_s: f64,
        /// Sub-steps it would take.
        needed: u32,
    },
    /// The explicit step was divided as its stability asks for.
    Divided {
        /// Number of parts.
        substeps: u32,
        /// Longest stable step [s].
        stable_s: f64,
    },
    /// The explicit step did not stay finite and was divided further than its stability asks for.
    DividedAgain {
        /// Number of parts.
        substeps: u32,
    },
    /// BDF2: no usable history, the step was made with implicit Euler.
    Started,
    /// BDF2: springs came into contact, the step was made with implicit Euler.
    ContactOnset,
    /// BDF2: the body turns too far in one step, it was made with implicit Euler.
    Spinning {
        /// Angle per step [rad].
        angle_rad: f64,
    },
    /// One linear solve per step: a free part turned too far in one step for that, and was slowed.
    SpinLimited {
        /// Angle per step before [rad].
        angle_rad: f64,
        /// Largest angle per step [rad].
        largest_rad: f64,
    },
    /// One linear solve per step: loose parts turned far and gained energy, the step was divided.
    SpinDivided {
        /// Number of parts.
        substeps: u32,
    },
    /// The step gained energy, it was made again with implicit Euler and as many Newton steps as needed.
    EnergyGained {
        /// Energy above what there was and what was put in [J].
        excess_j: f64,
    },
    /// The elements were inverted or collapsed, more Newton steps were allowed than asked for.
    Recovery,
    /// A part of the body hangs on nothing: there is no equilibrium.
    LooseBody,
    /// A part is held, but not against every rigid motion: its equilibrium is one of many or, where the
    /// loads drive the motion, does not exist.
    Underheld {
        /// The motion that is left, the first of them.
        motion: FreeMotion,
        /// Whether the loads drive it.
        driven: bool,
    },
    /// A factorisation met a pivot that is not positive; conjugate gradients solved instead.
    Pivot {
        /// Its displacement: 3 · copy + axis.
        displacement: u32,
    },
    /// The step was taken back because it did not stay finite.
    NotFinite,
    /// The step was taken back because it drew a part of the body out of any sensible range.
    OutOfRange {
        /// How far the part would reach, over its size.
        stretch: f64,
        /// Its size: the diagonal of its box at rest, or of its prescribed positions if larger [m].
        size_m: f64,
    },
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BadInput => write!(f, "step length, gravity, loads or parameters are not usable"),
            Self::TooLong { h_s, stable_s, needed } => write!(
                f,
                "step {h_s:.3e} s is longer than the longest stable one, {stable_s:.3e} s; \
                 it would take {needed} sub-steps: shorten it or choose an implicit scheme"
            ),
            Self::Divided { substeps, stable_s } => {
                write!(f, "divided into {substeps} sub-steps, the longest stable one is {stable_s:.3e} s")
            }
            Self::DividedAgain { substeps } => {
                write!(f, "did not stay finite: divided into {substeps} sub-steps")
            }
            Self::Started => write!(f, "no history yet: made with implicit Euler"),
            Self::ContactOnset => write!(f, "new contact: made with implicit Euler"),
            Self::Spinning { angle_rad } => {
                write!(f, "turns by {angle_rad:.2} rad per step: made with implicit Euler")
            }
            Self::SpinLimited { angle_rad, largest_rad } => {
                write!(
                    f,
                    "a loose part turned by {angle_rad:.2} rad per step: slowed to {largest_rad:.2} rad"
                )
            }
            Self::SpinDivided { substeps } => {
                write!(f, "loose parts turned far and gained energy: divided into {substeps} parts")
            }
            Self::EnergyGained { excess_j } => {
                write!(f, "gained {excess_j:.3e} J: made again with implicit Euler")
            }
            Self::Recovery => write!(f, "inverted or collapsed elements: more Newton steps allowed"),
            Self::LooseBody => write!(f, "a part hangs on nothing: no static equilibrium"),
            Self::Underheld { motion, driven } => {
                let (mass_kg, FreeMotion { slide, turn, about, .. }) = (motion.mass_kg, motion);
                write!(f, "nothing keeps a part of {mass_kg:.3e} kg from ")?;
                match motion.is_translation() {
                    true => write!(f, "sliding along {}", rounded(slide))?,
                    false => write!(f, "turning about {} through {} m", rounded(turn), rounded(about))?,
                }
                match driven {
                    true => write!(
                        f,
                        ", and the loads do: no static equilibrium; fix more of it, or use dynamics"
                    ),
                    false => write!(f, ": its equilibrium is one of many; fix more of it"),
                }
            }
            Self::Pivot { displacement } => write!(
                f,
                "Cholesky met a pivot that is not positive at node {} along {}: hardly anything holds it, or the \
                 stiffness spans more than double precision; conjugate gradients solved instead",
                displacement / 3,
                ['x', 'y', 'z'][*displacement as usize % 3]
            ),
            Self::NotFinite => write!(f, "did not stay finite: taken back"),
            Self::OutOfRange { stretch, size_m } => write!(
                f,
                "a part of {size_m:.3e} m would reach {stretch:.1e} times as far: taken back, the body is at rest; \
                 it is too soft for its loads, or the step too long or the solver's limits too low for it"
            ),
        }
    }
}

/// A vector with the digits one reads.
fn rounded(v: &Vector3<f64>) -> String {
    let size = v.amax().max(f64::MIN_POSITIVE);
    let digits = (3 - size.log10().floor() as i32).clamp(0, 12) as usize;
    format!("[{:.digits$}, {:.digits$}, {:.digits$}]", v.x + 0.0, v.y + 0.0, v.z + 0.0)
}

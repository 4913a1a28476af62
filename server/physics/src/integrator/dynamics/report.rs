//! What a step says about itself.

use std::fmt;

use super::Scheme;
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
    /// Newton's method, last solve; linear iterations are those of the whole step.
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
    /// The explicit step was divided.
    Divided {
        /// Number of parts.
        substeps: u32,
        /// Longest stable step [s].
        stable_s: f64,
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
    /// Newton's method stopped before its tolerance was reached; the report says how good the state
    /// is. Not said of the few steps of a fast setting, which are meant to stop early.
    Unconverged,
    /// The step was taken back because it did not stay finite.
    NotFinite,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BadInput => write!(f, "step length, gravity, loads or parameters are not usable"),
            Self::TooLong { h_s, stable_s, needed } => write!(
                f,
                "step {h_s:.3e} s is longer than the longest stable one, {stable_s:.3e} s; \
                 it would take {needed} sub-steps: shorten it, allow them, or choose an implicit scheme"
            ),
            Self::Divided { substeps, stable_s } => {
                write!(f, "divided into {substeps} sub-steps, the longest stable one is {stable_s:.3e} s")
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
            Self::Unconverged => write!(f, "Newton's method stopped before its tolerance"),
            Self::NotFinite => write!(f, "did not stay finite: taken back"),
        }
    }
}

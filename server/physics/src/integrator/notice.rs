//! What a step did differently from what was asked for, in words.

use std::fmt;

use nalgebra::Vector3;

use super::free_motion::FreeMotion;

/// Something that a step did differently from what was requested, and why.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Notice {
    /// A length, gravity, load, position or velocity among the inputs is unusable.
    BadInput,
    /// h exceeds the stable step of the explicit scheme, and the sub-steps it needs are not allowed.
    TooLong {
        /// The requested step [s].
        h_s: f64,
        /// Longest stable step [s].
        stable_s: f64,
        /// Sub-steps it would take.
        needed: u32,
    },
    /// The explicit step was divided into stable parts.
    Divided {
        /// Number of parts.
        substeps: u32,
        /// Longest stable step [s].
        stable_s: f64,
    },
    /// The explicit step did not stay finite and was divided further than its stability requires.
    DividedAgain {
        /// Number of parts.
        substeps: u32,
    },
    /// BDF2 has no usable history; the step was made with implicit Euler.
    Started,
    /// BDF2: springs came into contact; the step was made with implicit Euler.
    ContactOnset,
    /// BDF2: the body turns too far in one step, which was made with implicit Euler.
    Spinning {
        /// Angle per step [rad].
        angle_rad: f64,
    },
    /// One linear solve per step: a free part turned too far for that in one step and was slowed.
    SpinLimited {
        /// Angle per step before it was slowed [rad].
        angle_rad: f64,
        /// Largest angle per step [rad].
        largest_rad: f64,
    },
    /// One linear solve per step: free parts turned far and gained energy, so the step was divided.
    SpinDivided {
        /// Number of parts.
        substeps: u32,
    },
    /// The step gained energy and was repeated with implicit Euler and as many Newton steps as needed.
    EnergyGained {
        /// Energy gained beyond the work that was put in [J].
        excess_j: f64,
    },
    /// The internal forces did more work in the last steps than energy was released: the equations of these steps did not
    /// hold. The next steps take more solves.
    Unbalanced {
        /// Energy that came from nowhere [J].
        excess_j: f64,
        /// Whether the steps had taken several solves already.
        careful: bool,
        /// Whether it had happened not long before.
        again: bool,
    },
    /// Elements were inverted or collapsed, so more Newton steps were allowed than requested.
    Recovery,
    /// A part of the body is held nowhere, so there is no equilibrium.
    LooseBody,
    /// A part is held, but not against every rigid motion. Its equilibrium is one of many; if the loads
    /// drive the motion, there is none.
    Underheld {
        /// The first free motion found.
        motion: FreeMotion,
        /// Whether the loads drive it.
        driven: bool,
    },
    /// A factorisation met a pivot that is not positive; conjugate gradients solved instead.
    Pivot {
        /// The displacement it belongs to: 3 · copy + axis.
        displacement: u32,
    },
    /// The step together with the bodies that it touches did not stay finite, so it was made alone.
    Parted,
    /// The step was taken back because it did not stay finite.
    NotFinite,
    /// The step was taken back because it drew a part of the body out far beyond its size.
    OutOfRange {
        /// Extent that the part would have, over its size.
        stretch: f64,
        /// Its size [m]: the diagonal of its box at rest, or of its prescribed positions if larger.
        size_m: f64,
    },
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Each says what happened first, then what was done instead or what would help.
        match self {
            Self::BadInput => write!(f, "the step length, gravity, loads or parameters are not valid"),
            Self::TooLong { h_s, stable_s, needed } => write!(
                f,
                "the step of {h_s:.3e} s exceeds the stability limit of {stable_s:.3e} s and would need {needed} \
                 sub-steps; shorten it or choose an implicit scheme"
            ),
            Self::Divided { substeps, stable_s } => {
                write!(f, "divided into {substeps} sub-steps; the stability limit is {stable_s:.3e} s")
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
                    "a loose part turned by {angle_rad:.2} rad per step: slowed to {largest_rad:.2} rad per step"
                )
            }
            Self::SpinDivided { substeps } => {
                write!(f, "loose parts turned far and gained energy: divided into {substeps} sub-steps")
            }
            Self::Unbalanced { excess_j, careful, .. } => write!(
                f,
                "{excess_j:.1e} J came from nowhere in the last steps: {}",
                match careful {
                    false => "one solve did not balance their forces; the next steps take several",
                    true => "even several solves did not balance their forces",
                }
            ),
            Self::EnergyGained { excess_j } => {
                write!(f, "gained {excess_j:.3e} J of energy: repeated with implicit Euler")
            }
            Self::Recovery => write!(f, "inverted or collapsed elements: more Newton steps allowed"),
            Self::LooseBody => write!(f, "nothing holds a part of the body: no static equilibrium"),
            Self::Underheld { motion, driven } => {
                // The mass tells which part is meant: a crumb of a cut, or most of the body.
                let (mass_kg, FreeMotion { slide, turn, about, .. }) = (motion.mass_kg, motion);
                write!(f, "nothing keeps a part of {mass_kg:.3e} kg from ")?;
                match motion.is_translation() {
                    true => write!(f, "sliding along {}", rounded(slide))?,
                    false => write!(f, "turning about {} through {} m", rounded(turn), rounded(about))?,
                }
                // A motion that no load drives leaves an equilibrium, one of many.
                match driven {
                    true => write!(
                        f,
                        ", and the loads drive this motion: no static equilibrium; fix more of it, or use dynamics"
                    ),
                    false => write!(f, ": its equilibrium is not unique; fix more of it"),
                }
            }
            Self::Pivot { displacement } => write!(
                f,
                "Cholesky found a pivot that is not positive at node {} along {}, so conjugate gradients solved \
                 instead; hardly anything holds the node, or the stiffness ratio exceeds double precision",
                displacement / 3,
                ['x', 'y', 'z'][*displacement as usize % 3]
            ),
            Self::Parted => write!(
                f,
                "the step together with the bodies it touches did not stay finite: made without their contact"
            ),
            Self::NotFinite => write!(f, "did not stay finite: rolled back"),
            Self::OutOfRange { stretch, size_m } => write!(
                f,
                "a part of {size_m:.3e} m would extend over {stretch:.1e} times its size: rolled back to rest; \
                 it is too soft for its loads, the step too long, or the solver's limits too low"
            ),
        }
    }
}

/// Formats a vector with about four significant digits.
fn rounded(v: &Vector3<f64>) -> String {
    let size = v.amax().max(f64::MIN_POSITIVE);
    let digits = (3 - size.log10().floor() as i32).clamp(0, 12) as usize;
    format!("[{:.digits$}, {:.digits$}, {:.digits$}]", v.x + 0.0, v.y + 0.0, v.z + 0.0)
}

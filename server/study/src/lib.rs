//! What accuracy costs in time: the study behind `scindo accuracy`.
//!
//! The modules read from those that know nothing of the others to the one that drives them all. [`design`] says
//! what is varied (law, element, mesh, step, …), as keys of the scene, and picks configurations. A [`trial`] runs
//! one of them and times it; [`distance`] tells how far two runs are apart. A [`case`] is a scene with a goal and
//! a truth. The [`bench`] makes the runs of a case within the time it has, and keeps on disk what is finished.
//! [`reference`] says what the right answer is and how well it is known, for a scene by climbing refinements to
//! their limit as far as the time goes. [`advice`] keeps the configurations that nothing beats, tells which source
//! of error dominates there and recommends one for a time budget. [`settings`] are what is asked for and
//! [`result`] is what came out; [`page`] writes it for people, and [`study`] goes through all cases.
//!
//! Everything is a scene with changed keys, run by `scindo-world`: the study knows no mechanics,
//! and what a scene refuses is a result here like any other.

pub mod words;

mod random;

pub mod design;

pub mod trial;

pub mod distance;

pub mod case;

pub mod settings;

pub mod bench;

pub mod reference;

pub mod advice;

pub mod result;

pub mod page;

pub mod study;

// the other study: what breaks codes that deform and cut
#[allow(non_snake_case)] // the symbols of the field: X, K, M
pub mod stress;

pub use bench::progress::Progress;
pub use result::{CaseResult, Outcome, StudyResult};
pub use settings::Settings;
pub use study::{StudyError, run};

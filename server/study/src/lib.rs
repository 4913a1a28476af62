//! What accuracy costs in time: the study behind `scindo accuracy`.
//!
//! The modules are listed from those that know nothing of the others to the one that drives them all.
//! [`design`] defines the factors (law, element, mesh, step, …) as keys of the scene and picks
//! configurations. A [`trial`] runs one configuration and times it; [`trial::distance`] measures how far two
//! runs are apart. A [`case`] is a scene with a goal and a truth. The [`bench`] makes the runs of a case within
//! the available time and keeps finished runs on disk. [`reference`] finds the right answer and how well it
//! is known; for a scene it refines level by level as long as time allows. [`advice`] finds the Pareto front,
//! names the dominant source of error there and recommends one configuration for a time budget. [`settings`]
//! are the input and [`result`] is the output. [`page`] writes the result for people, and [`study`] goes
//! through all cases, or asks what each [effect](study::effects) of a scene costs.
//!
//! Everything is a scene with changed keys, run by `scindo-world`. The study knows no mechanics, and a
//! refused scene is a result like any other.

pub mod words;

pub mod design;

pub mod trial;

pub mod case;

pub mod settings;

pub mod bench;

pub mod reference;

pub mod advice;

pub mod result;

pub mod page;

pub mod study;

// Measurements of parts of the program: octree cells, multigrid, collision.
#[allow(non_snake_case)] // the symbols of the field: A, X, K
pub mod experiment;

// The other study: what breaks codes that deform and cut.
#[allow(non_snake_case)] // the symbols of the field: X, K, M
pub mod stress;

// What all of them found, beside the numbers that papers print.
pub mod book;

pub use bench::progress::Progress;
pub use result::{CaseResult, Outcome, StudyResult};
pub use settings::Settings;
pub use study::{StudyError, run};

//! What accuracy costs in time: the study behind `scindo accuracy`.
//!
//! The modules read in the direction of the work: a [`case`] is a scene with a goal and a
//! reference; its [`axes`] say what is varied (law, element, mesh, step, …) as keys of the scene;
//! [`design`] picks the configurations; a [`trial`] runs one and times it, [`wear`] looks
//! at a mesh after many cuts; [`reference`] says what
//! the right answer is and how well it is known, for a scene by a [`climb`] along refinements to
//! its [`limit`] as far as the time goes; [`distance`] compares; [`pareto`] keeps the
//! configurations that nothing beats; [`sources`] tells which source of error dominates there;
//! [`recommend`] picks one for a time budget; [`store`] keeps what is finished on disk; [`page`]
//! writes it for people. [`bench`] makes the runs within the time that [`forecast`] expects; `survey`
//! studies one case, and [`study`] all of them.
//!
//! Everything is a scene with changed keys, run by `scindo-world`: the study knows no mechanics,
//! and what a scene refuses is a result here like any other.

pub mod words;

pub mod case;

pub mod design;

pub mod trial;

pub mod reference;

pub mod distance;

pub mod page;

pub mod settings;

pub mod result;

pub mod bench;

pub mod advice;

mod survey;

pub mod study;

mod random;

// the other study: what breaks codes that deform and cut
#[allow(non_snake_case)] // the symbols of the field: X, K, M
pub mod stress;

pub use bench::progress::Progress;
pub use result::{CaseResult, Outcome, StudyResult};
pub use settings::Settings;
pub use study::{StudyError, run};

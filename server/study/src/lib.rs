//! What accuracy costs in time: the study behind `scindo accuracy`.
//!
//! The modules are listed from those that know nothing of the others to the one that drives them all.
//! [`report`] has what pages are made of: frame, plots, charts, pictures, tables.
//! [`design`] defines the factors (law, element, mesh, step, …) as keys of the scene and picks
//! configurations. A [`trial`] runs one configuration and times it; [`trial::distance`] measures how far two
//! runs are apart. A [`case`] is a scene with a goal and a truth. The [`bench`] makes the runs of a case within
//! the available time and keeps finished runs on disk. [`reference`] finds the right answer and how well it
//! is known; for a scene it refines level by level as long as time allows. [`advice`] finds the Pareto front,
//! names the dominant source of error there and recommends one configuration for a time budget. [`settings`]
//! are the input and [`result`] is the output. [`page`] writes the result for people, and [`study`] goes
//! through all cases, or asks what each [effect](study::effects) of a scene costs.
//!
//! Everything is a scene with changed keys, run by `scindo-world`. A refused scene is a result like any other. The
//! cases and experiments of papers are in `scindo-papers`, as a [`Library`] of names.

pub mod words;

pub mod report;

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

pub use bench::progress::Progress;
pub use result::{CaseResult, Outcome, StudyResult};
pub use settings::Settings;
pub use study::{Library, Scenes, StudyError, run, run_with};

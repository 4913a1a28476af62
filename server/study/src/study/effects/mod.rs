//! What each effect of a scene costs: the scene is stepped with it and without it.
//!
//! The twin without an effect starts each step from the state of the scene itself, and the two take turns in going
//! first. So both see the same contacts and the same deformation, and what else the machine does hits both alike. Only
//! the twins without gravity, loads or inertia move on their own.

mod switch;

mod saving;

mod measure;

pub use measure::{EffectsError, EffectsReport, Request, Row, measure};
pub use saving::{Off, Saving};
pub use switch::MOST_STEPS;

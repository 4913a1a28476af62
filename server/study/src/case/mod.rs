//! Cases: a scene, what is varied in it, what it is asked for, and where the right answer comes from.

mod definition;

mod ladder;

mod builtin;

mod cantilever;

mod cut_beam;

pub mod cutting;

mod bar;

mod scene;

mod vary;

mod refine;

mod subdivide;

mod gold;

mod shared;

pub use builtin::{NAMES, builtin};
pub use definition::{Case, Plan, Truth};
pub use ladder::Ladder;
pub use scene::{Wishes, from_scene};

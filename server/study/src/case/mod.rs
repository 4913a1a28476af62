//! Cases: a scene, the factors to vary, the number wanted, and the origin of the right answer.

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

pub mod gold;

mod shared;

pub use builtin::{NAMES, builtin};
pub use definition::{Case, Plan, Truth};
pub use ladder::Ladder;
pub use scene::{Wishes, from_scene};

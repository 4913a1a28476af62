//! Cases: a scene, the factors to vary, the number wanted, and the origin of the right answer.

mod definition;

mod ladder;

mod probe;

mod scene;

mod vary;

mod refine;

mod subdivide;

pub use definition::{Case, Plan, Truth};
pub use ladder::Ladder;
pub use probe::{Point, probe_tables};
pub use scene::{Wishes, from_scene};
pub use vary::LAWS;

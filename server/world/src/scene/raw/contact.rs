//! Keys of contact between bodies, and of how all contact is detected.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Contact of bodies with each other and with themselves.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawBodyContact {
    /// Coefficient of dry friction.
    #[schemars(range(min = 0.0, max = 10.0), extend("x-next" = "moist tissue on tissue has about 0.1"))]
    pub friction: f64,
    /// Stiffness, in multiples of Young's modulus over the size of an element.
    #[schemars(range(min = 0.1, max = 1000.0), extend("x-next" = "2 to 20; what is stiffer sinks in less"))]
    pub stiffness: f64,
    /// Broad phase: how the triangles that tools, bodies and clients touch are found. All methods give the same results;
    /// `scindo accuracy collision` measures the cost of each.
    pub broad_phase: RawBroadPhase,
}

impl Default for RawBodyContact {
    fn default() -> Self {
        Self { friction: 0.1, stiffness: 10.0, broad_phase: RawBroadPhase::default() }
    }
}

/// Method of broad phase.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawBroadPhase {
    /// Binary tree of axis-aligned boxes.
    #[default]
    AabbTree,
    /// Octree of triangles.
    Octree,
    /// Binary tree of spheres.
    SphereTree,
    /// Hashed grids, one per size of triangle.
    SpatialHash,
    /// Bounding volume hierarchy of the library parry3d.
    ParryBvh,
}

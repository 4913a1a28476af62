//! The tables of obstacles.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Vec3;

/// A rigid thing that stands still: bodies lie on it, slide along it and are stopped by it.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["half_space"]}, {"required": ["box"]}, {"required": ["sphere"]},
    {"required": ["capsule"]}, {"required": ["surface"]}]))]
pub struct RawObstacle {
    /// Name, unique among obstacles.
    #[schemars(regex(pattern = r"^[a-z0-9_-]+$"), length(min = 1, max = 64))]
    pub id: String,
    /// Everything behind a plane: a floor, a wall or a slope.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_space: Option<RawObstaclePlane>,
    /// A box along the world axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r#box: Option<RawObstacleBox>,
    /// A sphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<RawObstacleSphere>,
    /// A cylinder with hemispherical ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capsule: Option<RawObstacleCapsule>,
    /// A closed surface from a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<RawObstacleSurface>,
    /// Coefficient of dry friction between it and the bodies.
    #[serde(default = "friction")]
    #[schemars(range(min = 0.0, max = 10.0), extend("x-next" = "0 is ice, 0.3 moist tissue on steel, 1 rubber"))]
    pub friction: f64,
    /// Stiffness of the contact, in multiples of Young's modulus over the size of an element of the body.
    #[serde(default = "stiffness")]
    #[schemars(range(min = 0.1, max = 1000.0), extend("x-next" = "5 to 50; what is stiffer sinks in less"))]
    pub stiffness: f64,
}

fn friction() -> f64 {
    0.3
}

fn stiffness() -> f64 {
    20.0
}

/// Everything behind a plane.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawObstaclePlane {
    /// A point on the plane [m].
    pub point_m: Vec3,
    /// Vector out of the solid, to the side where bodies are. It may have any length except zero.
    pub normal: Vec3,
}

/// A box along the world axes.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawObstacleBox {
    /// Lower corner [m].
    pub min_m: Vec3,
    /// Upper corner [m].
    pub max_m: Vec3,
}

/// A sphere.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawObstacleSphere {
    /// Centre [m].
    pub centre_m: Vec3,
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1000.0, "x-next" = "give its radius in metres"))]
    pub radius_m: f64,
}

/// A cylinder with hemispherical ends.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawObstacleCapsule {
    /// Centres of the two hemispheres [m].
    pub ends_m: [Vec3; 2],
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1000.0, "x-next" = "give its radius in metres"))]
    pub radius_m: f64,
}

/// A closed surface from a file.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawObstacleSurface {
    /// File with triangles: `.obj`, `.stl` or `.ply`. Relative paths start at the scene file.
    pub file: String,
    /// Metres per length unit of the file.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1000.0, "x-next" = "0.001 for millimetres"))]
    pub scale: f64,
    /// Where the origin of the file lies [m].
    #[serde(default)]
    pub at_m: Vec3,
}

fn one() -> f64 {
    1.0
}

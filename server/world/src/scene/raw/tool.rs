//! The tables of tool shapes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::inputs::ToolShape;

/// Geometry of a tool, with its tip at the origin and its shaft along +z: exactly one key.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["blade"]}, {"required": ["sphere"]}, {"required": ["capsule"]},
    {"required": ["forceps"]}, {"required": ["retractor"]}, {"required": ["hook"]}]))]
pub struct RawShape {
    /// A blade with a straight cutting edge from tip to heel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blade: Option<RawBlade>,
    /// A sphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<RawSphere>,
    /// A cylinder with hemispherical ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capsule: Option<RawCapsule>,
    /// Two jaws, which squeeze what is between them and hold it by friction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub forceps: Option<RawForceps>,
    /// A shaft with two bars across it, which pulls a lip aside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retractor: Option<RawRetractor>,
    /// A rod with a bent end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hook: Option<RawHook>,
}

impl RawShape {
    /// The one shape that is given.
    pub fn geometry(&self) -> ToolShape {
        match self {
            RawShape { blade: Some(b), .. } => {
                ToolShape::Blade { length_m: b.length_m, thickness_m: b.thickness_m }
            }
            RawShape { sphere: Some(s), .. } => ToolShape::Sphere { radius_m: s.radius_m },
            RawShape { forceps: Some(f), .. } => ToolShape::Forceps {
                radius_m: f.radius_m,
                length_m: f.length_m,
                opening_m: f.opening_m,
                grip_force_n: f.grip_force_n,
                friction: f.friction,
            },
            RawShape { retractor: Some(r), .. } => ToolShape::Retractor {
                radius_m: r.radius_m,
                length_m: r.length_m,
                width_m: r.width_m,
                height_m: r.height_m,
            },
            RawShape { hook: Some(h), .. } => ToolShape::Hook {
                radius_m: h.radius_m,
                length_m: h.length_m,
                reach_m: h.reach_m,
                point_m: h.point_m,
            },
            RawShape { capsule, .. } => {
                let (radius_m, length_m) = capsule.as_ref().map_or((0.0, 0.0), |c| (c.radius_m, c.length_m));
                ToolShape::Capsule { radius_m, length_m }
            }
        }
    }
}

/// A blade.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBlade {
    /// Length of the cutting edge [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a scalpel has about 0.04 m"))]
    pub length_m: f64,
    /// Thickness of the blade [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "a scalpel has about 0.0005 m"))]
    pub thickness_m: f64,
}

/// A sphere.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSphere {
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a fingertip has about 0.008 m"))]
    pub radius_m: f64,
}

/// A cylinder with hemispherical ends.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawCapsule {
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a probe has about 0.002 m"))]
    pub radius_m: f64,
    /// Length of the axis between the centres of the two hemispheres [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a probe has about 0.1 m"))]
    pub length_m: f64,
}

/// Forceps. The tip is midway between the ends of the jaws, and the hinge lies up the shaft.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawForceps {
    /// Radius of a jaw [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "surgical forceps have about 0.0015 m"))]
    pub radius_m: f64,
    /// Length of a jaw, from its end to the hinge [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "surgical forceps have about 0.1 m"))]
    pub length_m: f64,
    /// Distance between the inner faces of the open jaws at their ends [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "surgical forceps open by about 0.01 m"))]
    pub opening_m: f64,
    /// Largest force with which each jaw squeezes [N].
    #[serde(default = "grip_force")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e4, "x-next" = "a light grip has about 2 N"))]
    pub grip_force_n: f64,
    /// Coefficient of dry friction between jaw and tissue. Held tissue slips beyond this times the force of each jaw.
    #[serde(default = "grip_friction")]
    #[schemars(extend("minimum" = 0.0, "maximum" = 10.0, "x-next" = "0.3 is moist tissue on smooth steel, 0.8 a serrated jaw"))]
    pub friction: f64,
}

fn grip_force() -> f64 {
    2.0
}

fn grip_friction() -> f64 {
    0.8
}

/// A retractor: a shaft with two bars across it, one at the tip and one above it.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRetractor {
    /// Radius of bars and shaft [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "a retractor has about 0.002 m"))]
    pub radius_m: f64,
    /// Length of the shaft [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a retractor has about 0.1 m"))]
    pub length_m: f64,
    /// Length of the bars [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a retractor has about 0.02 m"))]
    pub width_m: f64,
    /// Distance of the bars [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a little more than twice the radius"))]
    pub height_m: f64,
}

/// A hook: a rod whose end is bent aside, and up again at its point.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawHook {
    /// Radius of the rod [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "a skin hook has about 0.001 m"))]
    pub radius_m: f64,
    /// Length of the shaft [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a skin hook has about 0.1 m"))]
    pub length_m: f64,
    /// Distance of the point from the shaft [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a skin hook has about 0.005 m"))]
    pub reach_m: f64,
    /// Length of the point [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a skin hook has about 0.004 m"))]
    pub point_m: f64,
}

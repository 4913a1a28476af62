//! How a body is drawn. Viewers read it; the simulation does not.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a body is drawn.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLook {
    /// Colour of its skin, as `#rrggbb` in sRGB; absent: one of the viewer's, by the order of the bodies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "color"))]
    pub colour: Option<String>,
    /// 1 is opaque.
    #[serde(default = "opaque")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "0.3 to 0.6 shows what lies behind"))]
    pub opacity: f64,
    /// Colours inside its wounds, by rising depth; the last one also holds below its depth.
    #[serde(default)]
    #[schemars(length(max = 8))]
    pub layers: Vec<RawLayer>,
}

fn opaque() -> f64 {
    1.0
}

/// A layer of tissue below the skin.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLayer {
    /// Where it ends, measured from the skin inwards at rest [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "human skin ends at about 0.002 m, fat below it at 0.01 m"))]
    pub depth_m: f64,
    /// Its colour, as `#rrggbb` in sRGB.
    #[schemars(extend("format" = "color"))]
    pub colour: String,
}

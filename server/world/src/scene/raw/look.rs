//! Appearance of a body. Viewers read it; the simulation does not.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Appearance of a body.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLook {
    /// Colour of the skin, as `#rrggbb` in sRGB. Without it, the viewer chooses a colour by the order of the
    /// bodies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "color"))]
    pub colour: Option<String>,
    /// Opacity. 1 is opaque.
    #[serde(default = "opaque")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "0.3 to 0.6 shows what lies behind"))]
    pub opacity: f64,
    /// Colours inside wounds, in order of depth. The last layer also covers everything deeper.
    #[serde(default)]
    #[schemars(length(max = 8))]
    pub layers: Vec<RawLayer>,
    /// Image on the skin. Without it, the skin has one colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texture: Option<RawTexture>,
}

/// An image on the skin of a body. It moves and is cut with the body.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTexture {
    /// File of the image: PNG or JPEG, relative to the scene file.
    #[schemars(length(min = 1))]
    pub image: String,
    /// File of a surface with texture coordinates: .obj, relative to the scene file. The skin takes those of the
    /// closest point. Default: the surface that the mesh was made from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub surface: Option<String>,
    /// Factor from the length unit of `surface` to metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6, "x-next" = "0.001 for a file in millimetres"))]
    pub scale: Option<f64>,
    /// Size of the image on the body [m], in place of a surface. The image is repeated along the axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e3, "x-next" = "0.05 repeats tissue every 5 cm"))]
    pub repeat_m: Option<f64>,
}

fn opaque() -> f64 {
    1.0
}

/// A layer of tissue below the skin.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLayer {
    /// Depth at which the layer ends, measured from the skin inwards at rest [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "human skin ends at about 0.002 m, fat below it at 0.01 m"))]
    pub depth_m: f64,
    /// Colour of the layer, as `#rrggbb` in sRGB.
    #[schemars(extend("format" = "color"))]
    pub colour: String,
}

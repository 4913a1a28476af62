//! The skin of a body: a surface finer than its elements.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A surface finer than the elements.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSkin {
    /// Which triangles the skin consists of: the faces of the elements' boundary, `divided`, or the surface's `own`.
    #[serde(default)]
    pub triangles: RawSkinTriangles,
    /// Number n of parts into which each edge of the elements' boundary is divided. Each face then has n²
    /// skin triangles. Default: 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 32), extend("x-next" = "2 to 6 looks smooth; the number of triangles grows \
        with the square"))]
    pub divisions: Option<u32>,
    /// File of the surface that the skin follows: .obj, .stl or .ply, relative to the scene file. Default:
    /// the surface that the mesh was made from; without one, the boundary of the elements.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub surface: Option<String>,
    /// Factor from the length unit of `surface` to metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6, "x-next" = "0.001 for a file in millimetres"))]
    pub scale: Option<f64>,
    /// Snapping distance as a fraction of an edge. A skin vertex closer to a cut is moved onto it, and its
    /// triangles are not split. 0 always splits.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.5), extend("x-next" = "0.3 leaves few thin triangles along a cut"))]
    pub snapping: f64,
}

/// Triangles of a skin.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawSkinTriangles {
    /// The faces of the elements' boundary, divided. They follow the surface.
    #[default]
    Divided,
    /// Those of the surface, so that its shape and its texture coordinates are exact. Faces of the elements divide
    /// them further. Where the elements are too coarse for the surface, the skin follows it as a divided one does.
    /// Cells can have only such a skin; where they are cut, about two cells on either side, it is that of the cells.
    Own,
}

//! Keys of bodies of octree cells, and of regions of another material.

use schemars::JsonSchema;
use scindo_physics::material::Material;
use serde::{Deserialize, Serialize};

use super::RawWhere;

/// Cells of `element = "octree"`. The finest ones are cubes; as many as `cells` of the mesh lie along its longest
/// side. Inside the body they are joined to larger ones.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawOctree {
    /// Number of levels of coarsening: the largest cells are 2^levels finest cells wide. 0 makes all cells
    /// equal.
    #[schemars(range(max = 8), extend("x-next" = "3 or 4 suits most bodies; 0 makes all cells equal"))]
    pub levels: u8,
    /// Level that is simulated. 0 simulates the cells themselves. 1 and 2 simulate composite elements that
    /// are 2 and 4 finest cells wide; cuts and surface stay as fine as the cells.
    #[schemars(range(max = 2), extend("x-next" = "0 for accuracy, 1 or 2 for speed"))]
    pub simulate_level: u8,
}

impl Default for RawOctree {
    fn default() -> Self {
        Self { levels: 3, simulate_level: 0 }
    }
}

/// A region of another material: exactly one of `where`, `surface`. What is not given is that of the body. Where
/// regions overlap, the last one counts.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["where"]}, {"required": ["surface"]}]))]
pub struct RawMaterial {
    /// The cells whose centres lie in this region: exactly one of `box`, `sphere`, `half_space`, `slab`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r#where: Option<RawWhere>,
    /// File of a surface around the region: .obj, .stl or .ply, relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub surface: Option<String>,
    /// Factor from the length unit of `surface` to metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6, "x-next" = "0.001 for a file in millimetres"))]
    pub scale: Option<f64>,
    /// Young's modulus [Pa].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = *Material::YOUNG_PA.start(), "maximum" = *Material::YOUNG_PA.end(),
        "x-next" = "soft tissue lies between 1e3 and 1e6 Pa"))]
    pub young_pa: Option<f64>,
    /// Poisson's ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = *Material::POISSON.start(), "maximum" = *Material::POISSON.end(),
        "x-next" = "0.45 to 0.49 for nearly incompressible tissue; 0.5 would need a pressure field"))]
    pub poisson: Option<f64>,
    /// Density in the rest state [kg/m³].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = *Material::DENSITY_KG_M3.start(), "maximum" = *Material::DENSITY_KG_M3.end(),
        "x-next" = "soft tissue has about 1000 kg/m3"))]
    pub density_kg_m3: Option<f64>,
}

//! Keys of regions of another material.

use schemars::JsonSchema;
use scindo_physics::material::{Fibres, Material, Prony};
use serde::{Deserialize, Serialize};

use super::{RawWhere, Vec3};

/// A region of another material: exactly one of `where`, `surface`, `group`. What is not given is that of the body.
/// Where regions overlap, the last one counts. An element belongs to one region as a whole.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["where"]}, {"required": ["surface"]}, {"required": ["group"]}]))]
pub struct RawMaterial {
    /// The elements whose centres lie in this region: exactly one of `box`, `sphere`, `half_space`, `slab`.
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
    /// The elements of a group that `mesh.file` names: a physical group of Gmsh by its name or number, or the cells of
    /// a VTK file with this whole number in a cell array. `scindo mesh` lists the groups of a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1), extend("x-next" = "\"tumour\" or \"2\"; `scindo mesh FILE -o OUT.vtu` lists the groups of a file"))]
    pub group: Option<String>,
    /// Cell array that `group` is a value of. Needed only if several arrays of the file have this value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub array: Option<String>,
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

/// A family of parallel fibres. It adds to the stiffness along them. Two or three perpendicular families make the body
/// orthotropic.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawFibre {
    /// Direction of the fibres at rest. Its length does not matter.
    pub direction: Vec3,
    /// Stiffness k₁ [Pa], added to Young's modulus along the fibres at small strains. In tension only, except in the
    /// linear law.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = *Fibres::STIFFNESS_PA.end(),
        "x-next" = "muscle has a few times its young_pa, tendon a thousand times"))]
    pub stiffness_pa: f64,
    /// Stiffening k₂: the energy is k₁ (exp(k₂ ε²) − 1)/(2 k₂) with the Green strain ε along the fibres, after Holzapfel,
    /// Gasser and Ogden 2000. 0 is linear in ε.
    #[serde(default)]
    #[schemars(range(min = *Fibres::STIFFENING.start(), max = *Fibres::STIFFENING.end()), extend("x-next" = "arteries have 1 to 100"))]
    pub stiffening: f64,
}

/// A Maxwell element beside the law: a spring and a dashpot in series, one term of a Prony series. The body then relaxes
/// and creeps; its `young_pa` is what remains after a long time. Changes of volume stay elastic.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawProny {
    /// Shear modulus g of the spring over that of the body: a shear that is applied suddenly meets 1 + g times the modulus
    /// that remains.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = *Prony::RATIO.end(),
        "x-next" = "0.5 to 3 for soft organs"))]
    pub ratio: f64,
    /// Relaxation time τ [s]: held stretched, the spring loses its stress as exp(−t/τ).
    #[schemars(range(min = *Prony::TIME_S.start(), max = *Prony::TIME_S.end()),
        extend("x-next" = "0.1 to 100 s for soft organs"))]
    pub time_s: f64,
}

//! Why a model cannot be built.

use scindo_matter::element::ElementKind;
use scindo_matter::material::{Law, MaterialError, RegionsError};
use scindo_matter::mesh::MeshError;
use thiserror::Error;

use super::Volumetric;

/// A combination of mesh, element, law and remedy for which no model can be built.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ModelError {
    /// The mesh is unusable.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A material constant is out of range.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// The regions of other materials do not fit the mesh.
    #[error(transparent)]
    Regions(#[from] RegionsError),
    /// Node-averaged volume has no meaning between elements of different materials.
    #[error(
        "node-averaged volume does not go with regions of other materials; take full integration or tet10"
    )]
    AveragedRegions,
    /// The remedy against locking belongs to another element.
    #[error(
        "{remedy:?} does not go with {element:?} elements; node-averaged volume goes with Tet4, \
         selective integration with Hex8"
    )]
    Remedy {
        /// Element of the model.
        element: ElementKind,
        /// Remedy requested.
        remedy: Volumetric,
    },
    /// The law has no volumetric part that a remedy could treat apart.
    #[error(
        "the law {law:?} has no separate volumetric part, so {remedy:?} cannot be used with it; \
         choose linear, corotational or neo-hookean, or full integration"
    )]
    NoSplit {
        /// Law of the model.
        law: Law,
        /// Remedy requested.
        remedy: Volumetric,
    },
    /// The share of the element-wise volumetric energy is not a fraction.
    #[error("kept = {kept} is outside 0 … 1")]
    Kept {
        /// Share given.
        kept: f64,
    },
    /// A spring names a node that does not exist, or has an unusable number.
    #[error("spring {spring} is unusable: its nodes must differ and exist, k and L be finite and ≥ 0")]
    Spring {
        /// Index of the spring.
        spring: usize,
    },
}

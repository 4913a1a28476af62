//! Reasons why a body cannot be made or changed as requested.

use scindo_algebra::assembly::ModelError;
use scindo_matter::cut::CutError;
use scindo_matter::material::{MaterialError, RegionsError};
use scindo_matter::mesh::MeshError;
use scindo_matter::skin::SkinError;
use thiserror::Error;

use crate::integrator::DynamicsError;

/// A refused request; the body is as it was.
#[derive(Debug, Error)]
pub enum BodyError {
    /// The rest mesh cannot be simulated.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A material constant is out of range.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// The regions of other materials do not fit the mesh.
    #[error(transparent)]
    Regions(#[from] RegionsError),
    /// The discrete model cannot be made.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The integrator's parameters are out of range.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// Two settings that do not go together.
    #[error("{what} does not go with {with}; take {instead}")]
    Combination {
        /// The request that is refused.
        what: &'static str,
        /// The setting it conflicts with.
        with: &'static str,
        /// A setting that works instead.
        instead: &'static str,
    },
    /// A cut was refused.
    #[error(transparent)]
    Cut(#[from] CutError),
    /// The skin cannot be put on.
    #[error(transparent)]
    Skin(#[from] SkinError),
    /// A solver setting is out of range.
    #[error("{name} = {found} is outside {allowed}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Value found.
        found: f64,
        /// Allowed range in words.
        allowed: &'static str,
    },
    /// A criterion for the size of cells is out of range.
    #[error("{name} = {found:?}: allowed are {allowed}")]
    Criterion {
        /// Name of the criterion.
        name: &'static str,
        /// Values found.
        found: [f64; 2],
        /// The range, in words.
        allowed: &'static str,
    },
    /// The threads could not be started.
    #[error("cannot start the physics threads: {0}; ask for fewer")]
    Threads(std::io::Error),
    /// A node that the mesh does not have.
    #[error("node {node} does not exist, the mesh has nodes 0..{n_nodes}")]
    NoSuchNode {
        /// The node that was asked for.
        node: u32,
        /// Number of nodes.
        n_nodes: usize,
    },
    /// A force or displacement that is NaN, infinite or absurd.
    #[error("{quantity} = {found:?} must be finite and below 1e12 in size")]
    NonFinite {
        /// Name of the quantity, with its unit.
        quantity: &'static str,
        /// Value found.
        found: [f64; 3],
    },
    /// A static equilibrium was requested, but a part of the body is held nowhere.
    #[error(
        "part {part} ({mass_kg:.3e} kg) is fixed nowhere, so it has no static equilibrium; fix it or use dynamics"
    )]
    LoosePart {
        /// Number of the part that nothing holds.
        part: usize,
        /// Its mass [kg].
        mass_kg: f64,
    },
    /// A load on a selection that has no surface or volume to carry it.
    #[error(
        "the selected nodes contain no {carrier}, so {force_n:?} N cannot be distributed over it; select more nodes"
    )]
    NothingSelected {
        /// "surface" or "volume".
        carrier: &'static str,
        /// Total force [N].
        force_n: [f64; 3],
    },
    /// A pressure on a selection that contains no face of the surface.
    #[error(
        "the selected nodes contain no whole face of the surface, so {pressure_pa} Pa act on nothing; select more nodes"
    )]
    NoSkinFace {
        /// The pressure [Pa].
        pressure_pa: f64,
    },
    /// A list of errors with another length than that of the cells.
    #[error("{found} errors given for {expected} cells")]
    ErrorLength {
        /// Length found.
        found: usize,
        /// Number of cells.
        expected: usize,
    },
    /// A state array of the wrong length.
    #[error("{found} entries given for {expected} copies")]
    StateLength {
        /// Length found.
        found: usize,
        /// Number of copies.
        expected: usize,
    },
    /// A state entry that is NaN, infinite or absurd.
    #[error("position or velocity of copy {copy} is not finite or above 1e12 in size")]
    StateValue {
        /// Copy id.
        copy: usize,
    },
}

//! Parts of the method that can be switched off, to show that the hard cases need them.
//!
//! Only the mutation check of the stability suite sets this; no key of a scene does.

/// Which parts are switched off; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Ablation {
    /// The copies of a node share its mass evenly instead of carrying that of their pieces.
    pub piece_masses: bool,
    /// The signs of a sweep come from plain floating-point determinants, not from exact predicates.
    pub exact_predicates: bool,
    /// The fast path linearises at the positions of the last step instead of the inertial predictor.
    pub predictor: bool,
    /// The fast path bounds friction by the normal force of the last step instead of that at the end of this one.
    pub lagged_friction: bool,
    /// One linear solve per step takes the stiffness of relaxed material under tension, too, and velocities for rates of
    /// strain.
    pub twists: bool,
    /// Newton's method takes every full step, even if the potential rises.
    pub line_search: bool,
    /// Coarse levels of multigrid do not see cuts inside their cells. Cases apply this themselves.
    pub duplicates: bool,
    /// Hanging corners of octree cells count as vertices of their own. Cases apply this themselves.
    pub hanging_weights: bool,
    /// Hanging corners keep the vertices that they had before a cut. Cases apply this themselves.
    pub stale_vertices: bool,
}

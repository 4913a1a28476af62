//! Parts of the method that can be taken out, to see that the hard cases need them.
//!
//! Nothing but the mutation check of the stability suite sets this: no key of a scene leads here.

/// What is taken out; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ablation {
    /// The copies of a node share its mass evenly instead of carrying that of their pieces.
    pub piece_masses: bool,
    /// Signs of a sweep by plain floating-point determinants.
    pub exact_predicates: bool,
    /// The fast path linearises at the positions of the last step instead of the inertial predictor.
    pub predictor: bool,
    /// Newton's method takes every full step, whatever becomes of the potential.
    pub line_search: bool,
}

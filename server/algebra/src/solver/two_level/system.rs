//! The system that a coarse space belongs to.

use nalgebra::Vector3;
use scindo_matter::element::FixedCopy;

use crate::operator::{Block6, Spring};

/// A = `mass_factor` M + `scale` K̂ + springs at some positions, as far as a coarse space needs it.
#[derive(Clone, Copy, Debug)]
pub struct CoarseSystem<'a> {
    /// Position of every copy [m].
    pub x: &'a [Vector3<f64>],
    /// Whether the stiffness turns with the material.
    pub rotates: bool,
    /// Factor of the stiffness.
    pub scale: f64,
    /// Factor of the mass.
    pub mass_factor: f64,
    /// Diagonal block of every copy, springs not included.
    pub diagonal: &'a [Block6],
    /// Prescribed directions.
    pub fixed: &'a [FixedCopy],
    /// Springs of contact at the copies.
    pub springs: &'a [Spring],
}

//! The quadrature points of a body, in double precision.

use std::fmt::Debug;

use nalgebra::{Matrix3, Vector3};

use crate::material::{Lame, Material, Region};

/// A quadrature point of a deformed body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point<'a> {
    /// Its element: a piece of linear tetrahedra, a whole element of the others.
    pub element: usize,
    /// Nodes of the element.
    pub nodes: &'a [u32],
    /// ∇N_a [1/m] at rest, one per node.
    pub gradients: &'a [Vector3<f64>],
    /// Its weight w [m³] at rest.
    pub weight: f64,
    /// Deformation gradient F.
    pub F: Matrix3<f64>,
    /// Its region: 0 is the body's own material, n the n-th of [`Points::regions`].
    pub region: u16,
}

/// What has quadrature points.
pub trait Points: Debug + Sync {
    /// Calls `visit` for every quadrature point with the nodes at `x` [m], element by element.
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>));

    /// Regions with other constants than the body; region number n is entry n − 1.
    fn regions(&self) -> &[Region] {
        &[]
    }

    /// Lamé constants [Pa] of a region of a body of `material`.
    fn lame(&self, region: u16, material: &Material) -> Lame {
        Region::numbered(self.regions(), region).map_or_else(|| material.lame(), Region::lame)
    }

    /// Elastic energy [J] with the nodes at `x` [m], without remedies against locking.
    fn energy(&self, material: &Material, x: &[Vector3<f64>]) -> f64 {
        let mut energy = 0.0;
        self.for_points(x, &mut |point| {
            energy += point.weight * material.law.energy(&point.F, self.lame(point.region, material));
        });
        energy
    }

    /// Returns the elastic energy [J] with the nodes at `x` [m] and writes the internal force on every node [N]
    /// to `f_int`, without remedies against locking.
    fn elastic_forces(&self, material: &Material, x: &[Vector3<f64>], f_int: &mut [Vector3<f64>]) -> f64 {
        let law = material.law;
        let mut energy = 0.0;
        f_int.fill(Vector3::zeros());
        self.for_points(x, &mut |point| {
            let lame = self.lame(point.region, material);
            energy += point.weight * law.energy(&point.F, lame);
            let P = law.stress(&point.F, lame);
            for (&node, g) in point.nodes.iter().zip(point.gradients) {
                f_int[node as usize] += point.weight * (P * g);
            }
        });
        energy
    }
}

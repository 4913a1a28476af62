//! What can be measured on a body. Double precision throughout, nothing here is part of a step.

use nalgebra::{Matrix3, Vector3};

use super::Body;
use crate::cut::Piece;
use crate::element::{deformation_gradient, piece_energy, piece_forces};

impl Body {
    /// Σ m [kg].
    pub fn total_mass(&self) -> f64 {
        self.mass.iter().sum()
    }

    /// Σ m x / Σ m [m].
    pub fn centre_of_mass(&self) -> Vector3<f64> {
        self.weighted(&self.state.x) / self.total_mass()
    }

    /// Σ m v [kg m/s].
    pub fn momentum(&self) -> Vector3<f64> {
        self.weighted(&self.state.v)
    }

    /// Σ m (x − c) × v about the centre of mass c [kg m²/s].
    pub fn angular_momentum(&self) -> Vector3<f64> {
        let centre = self.centre_of_mass();
        let spin = |((m, x), v): ((&f64, &Vector3<f64>), &Vector3<f64>)| *m * (x - centre).cross(v);
        self.mass.iter().zip(&self.state.x).zip(&self.state.v).map(spin).sum()
    }

    /// ½ Σ m v² [J].
    pub fn kinetic_energy(&self) -> f64 {
        self.mass.iter().zip(&self.state.v).map(|(m, v)| 0.5 * m * v.norm_squared()).sum()
    }

    /// Σ w V ψ(F) over the pieces [J].
    pub fn elastic_energy(&self) -> f64 {
        let (law, lame) = (self.material.law, self.material.lame());
        self.deformed_pieces().map(|d| piece_energy(law, lame, &d.F, d.volume)).sum()
    }

    /// Σ w V det F, the present volume [m³].
    pub fn volume(&self) -> f64 {
        self.deformed_pieces().map(|d| d.volume * d.F.determinant()).sum()
    }

    /// Smallest det F of any piece [1]; ≤ 0 means inverted.
    pub fn least_volume_ratio(&self) -> f64 {
        self.deformed_pieces().map(|d| d.F.determinant()).fold(f64::INFINITY, f64::min)
    }

    /// Cauchy stress P Fᵀ / det F of every piece [Pa]; 0 where a piece is flat or inverted.
    pub fn cauchy_stresses(&self) -> Vec<Matrix3<f64>> {
        let (law, lame) = (self.material.law, self.material.lame());
        let stress = |d: Deformed<'_>| {
            let J = d.F.determinant();
            if J > 1e-9 { law.stress(&d.F, lame) * d.F.transpose() / J } else { Matrix3::zeros() }
        };
        self.deformed_pieces().map(stress).collect()
    }

    /// Internal force on every copy [N]; it pulls the body back, so it is subtracted from the loads.
    pub fn internal_forces(&self) -> Vec<Vector3<f64>> {
        let mut f_int = Vec::new();
        self.elastic_response(&mut f_int);
        f_int
    }

    /// Elastic energy [J], and the internal force on every copy [N] into `f_int`.
    pub(super) fn elastic_response(&self, f_int: &mut Vec<Vector3<f64>>) -> f64 {
        let (law, lame) = (self.material.law, self.material.lame());
        f_int.clear();
        f_int.resize(self.state.x.len(), Vector3::zeros());
        let mut energy = 0.0;
        for d in self.deformed_pieces() {
            energy += piece_energy(law, lame, &d.F, d.volume);
            let P = law.stress(&d.F, lame);
            for (&copy, force) in d.piece.copies.iter().zip(piece_forces(&P, &d.g, d.volume)) {
                f_int[copy as usize] += force;
            }
        }
        energy
    }

    /// Sum of the forces [N] that hold the prescribed directions of `nodes` against elasticity,
    /// gravity [m/s²] and loads (without the inertia of the nodes themselves).
    pub fn reaction(&self, nodes: &[u32], gravity: Vector3<f64>) -> Vector3<f64> {
        let f_int = self.internal_forces();
        let mut sum = Vector3::zeros();
        for fixed in self.fixed.iter().filter(|f| nodes.contains(&f.copy)) {
            let c = fixed.copy as usize;
            let held = f_int[c] - self.mass[c] * gravity - self.load[c];
            for axis in (0..3).filter(|&axis| fixed.axes[axis]) {
                sum[axis] += held[axis];
            }
        }
        sum
    }

    /// Position of every surface vertex [m], into `out`.
    pub fn surface_positions(&self, out: &mut Vec<[f32; 3]>) {
        out.clear();
        out.extend(self.cut_mesh.surface().vertices.iter().map(|vertex| {
            let x = vertex.position(&self.state.x);
            [x.x as f32, x.y as f32, x.z as f32]
        }));
    }

    fn weighted(&self, values: &[Vector3<f64>]) -> Vector3<f64> {
        self.mass.iter().zip(values).map(|(m, v)| *m * v).sum()
    }

    fn deformed_pieces(&self) -> impl Iterator<Item = Deformed<'_>> {
        let mesh = self.cut_mesh.mesh();
        self.cut_mesh.pieces().iter().map(move |piece| {
            let e = piece.element as usize;
            let g = mesh.gradients(e);
            let F = deformation_gradient(&piece.copies.map(|c| self.state.x[c as usize]), &g);
            Deformed { piece, F, g, volume: piece.fraction * mesh.volume(e) }
        })
    }
}

/// A piece in its present configuration.
struct Deformed<'a> {
    piece: &'a Piece,
    F: Matrix3<f64>,
    g: [Vector3<f64>; 4],
    /// w V [m³] at rest.
    volume: f64,
}

//! Quantities measured on a body, all in double precision. No step needs them.

use nalgebra::{Matrix3, Vector3};

use super::shape::Shape;
use super::{Body, Path};
use crate::element::piece_energy;
use crate::estimate::{CutTets, MeshError, StressRecovery};
use crate::operator::exact;

/// Counts of elements so flat that one of their motions is far stiffer than the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StiffMotions {
    /// Pieces of such elements.
    pub pieces: usize,
    /// Copies that the solver moves relative to others, so that these motions cost no iterations.
    pub substituted: usize,
    /// Pieces that keep a stiff motion, because too many copies take part in it.
    pub left: usize,
}

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

    /// How the solver of the last step treated elements so flat that one of their motions is far stiffer
    /// than the others. All 0 in a sound mesh; quadratic and hexahedral elements are not examined.
    pub fn stiff_motions(&self) -> StiffMotions {
        let [pieces, substituted, left] = match &self.path {
            Path::Fast(fast) => fast.stiff_motions(),
            Path::General(general) => general.dynamics.stiff_motions(),
        };
        StiffMotions { pieces, substituted, left }
    }

    /// ½ vᵀ M v [J].
    pub fn kinetic_energy(&self) -> f64 {
        match &self.path {
            Path::Fast(_) => {
                self.mass.iter().zip(&self.state.v).map(|(m, v)| 0.5 * m * v.norm_squared()).sum()
            }
            Path::General(general) => general.dynamics.kinetic_energy(&self.state.v),
        }
    }

    /// Σ w V ψ(F) over the pieces [J].
    pub fn elastic_energy(&self) -> f64 {
        match &self.path {
            Path::Fast(_) => {
                let (law, lame) = (self.material.law, self.material.lame());
                self.deformed_pieces().map(|d| piece_energy(law, lame, &d.F, d.volume)).sum()
            }
            Path::General(general) => general.model().energy(&self.state.x),
        }
    }

    /// Σ w V det F, the present volume [m³].
    pub fn volume(&self) -> f64 {
        match &self.path {
            Path::Fast(_) => self.deformed_pieces().map(|d| d.volume * d.F.determinant()).sum(),
            Path::General(general) => {
                let model = general.model();
                let element = |e: usize| -> f64 {
                    let points = model.weights(e).iter().enumerate();
                    points
                        .map(|(q, w)| w * model.deformation_gradient(e, q, &self.state.x).determinant())
                        .sum()
                };
                (0..model.n_elements()).map(element).sum()
            }
        }
    }

    /// Smallest det F of any piece [1], or of any quadrature point on the general path; ≤ 0 means inverted.
    pub fn least_volume_ratio(&self) -> f64 {
        let least = f64::min;
        match &self.path {
            Path::Fast(_) => self.deformed_pieces().map(|d| d.F.determinant()).fold(f64::INFINITY, least),
            Path::General(general) => {
                let model = general.model();
                let points =
                    (0..model.n_elements()).flat_map(|e| (0..model.kind().points()).map(move |q| (e, q)));
                points
                    .map(|(e, q)| model.deformation_gradient(e, q, &self.state.x).determinant())
                    .fold(f64::INFINITY, least)
            }
        }
    }

    /// Cauchy stress P Fᵀ / det F of every piece [Pa], averaged over the quadrature points of its
    /// element; 0 where it is flat or inverted.
    pub fn cauchy_stresses(&self) -> Vec<Matrix3<f64>> {
        let (law, lame) = (self.material.law, self.material.lame());
        let stress = |F: &Matrix3<f64>| {
            let J = F.determinant();
            if J > 1e-9 { law.stress(F, lame) * F.transpose() / J } else { Matrix3::zeros() }
        };
        match &self.path {
            Path::Fast(_) => self.deformed_pieces().map(|d| stress(&d.F)).collect(),
            Path::General(general) => {
                let model = general.model();
                let mean = |e: usize| -> Matrix3<f64> {
                    let points = model.weights(e).iter().enumerate();
                    let sum: Matrix3<f64> = points
                        .map(|(q, w)| *w * stress(&model.deformation_gradient(e, q, &self.state.x)))
                        .sum();
                    sum / model.volume(e)
                };
                let pieces = self.cut_mesh.pieces().len();
                (0..pieces).map(|p| mean(self.shape.element_of(p))).collect()
            }
        }
    }

    /// Estimates the discretisation error of linear tetrahedra, cut or not; `None` for other elements.
    pub fn mesh_error(&self, recovery: &mut StressRecovery) -> Option<MeshError> {
        let tets = CutTets::new(self.mesh(), self.pieces(), self.n_copies());
        let (law, lame) = (self.material.law, self.material.lame());
        matches!(self.shape, Shape::Tet4).then(|| recovery.estimate(&tets, &self.state.x, law, lame))
    }

    /// Internal force on every node [N]; it pulls the body back, so it is subtracted from the loads.
    pub fn internal_forces(&self) -> Vec<Vector3<f64>> {
        let mut f_int = Vec::new();
        self.elastic_response(&mut f_int);
        f_int
    }

    /// Returns the elastic energy [J] and writes the internal force on every node [N] to `f_int`.
    pub(super) fn elastic_response(&self, f_int: &mut Vec<Vector3<f64>>) -> f64 {
        f_int.clear();
        f_int.resize(self.state.x.len(), Vector3::zeros());
        if let Path::General(general) = &self.path {
            return general.model().internal_forces(&self.state.x, f_int);
        }
        let material = (self.material.law, self.material.lame());
        exact::internal_forces(&self.cut_mesh, material, &self.state.x, f_int)
    }

    /// Sum of the forces [N] that hold the prescribed directions of `nodes` against elasticity, gravity
    /// [m/s²] and loads, without the inertia of the nodes themselves. Where a cut passes exactly through
    /// a held node, each lip has a held copy of it: all of them count.
    pub fn reaction(&self, nodes: &[u32], gravity: Vector3<f64>) -> Vector3<f64> {
        let f_int = self.internal_forces();
        let mut sum = Vector3::zeros();
        let node_of = |copy: u32| self.cut_mesh.copy_node().get(copy as usize).copied().unwrap_or(copy);
        for fixed in self.fixed.iter().filter(|f| nodes.contains(&node_of(f.copy))) {
            let c = fixed.copy as usize;
            let held = f_int[c] - self.weight(c, gravity) - self.load[c];
            for axis in (0..3).filter(|&axis| fixed.axes[axis]) {
                sum[axis] += held[axis];
            }
        }
        sum
    }

    /// Writes the position of every surface vertex [m] to `out`.
    pub fn surface_positions(&self, out: &mut Vec<[f32; 3]>) {
        out.clear();
        out.extend(self.surface().vertices.iter().map(|vertex| {
            let x = vertex.position(&self.state.x);
            [x.x as f32, x.y as f32, x.z as f32]
        }));
    }

    /// Force of gravity on node `c` [N], as the integrator applies it.
    fn weight(&self, c: usize, gravity: Vector3<f64>) -> Vector3<f64> {
        match &self.path {
            Path::Fast(_) => self.mass[c] * gravity,
            Path::General(general) => general.dynamics.weight(c, gravity),
        }
    }

    fn weighted(&self, values: &[Vector3<f64>]) -> Vector3<f64> {
        self.mass.iter().zip(values).map(|(m, v)| *m * v).sum()
    }

    fn deformed_pieces(&self) -> impl Iterator<Item = exact::Deformed<'_>> {
        exact::deformed_pieces(&self.cut_mesh, &self.state.x)
    }
}

//! Quantities measured on a body, all in double precision. No step needs them.

use nalgebra::{Matrix3, Vector3};
use scindo_algebra::assembly::Model;
use scindo_algebra::solver::multigrid::{CoarsestSolve, LevelReport};
use scindo_matter::material::{first_piola, matrix};
use scindo_matter::team::Team;

use super::{Body, BodyError};
use crate::body::estimate::{CellRecovery, CutTets, MeshError, StressRecovery};

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
    /// than the others. All 0 in a sound mesh. Quadratic and hexahedral elements are not examined; of cut quadratic
    /// ones, `substituted` counts the mid-edge nodes of small pieces.
    pub fn stiff_motions(&self) -> StiffMotions {
        let [pieces, substituted, left] = self.dynamics.solver().stiff_motions();
        StiffMotions { pieces, substituted, left }
    }

    /// Figures of the levels of multigrid, from the finest on, and how the coarsest one is solved; `None` if the
    /// method is another one or the discretisation has no levels.
    pub fn levels(&self) -> Option<(Vec<LevelReport>, CoarsestSolve)> {
        self.dynamics.solver().levels()
    }

    /// ½ vᵀ M v [J].
    pub fn kinetic_energy(&self) -> f64 {
        self.dynamics.solver().kinetic_energy(&self.mass, &self.state.v)
    }

    /// Elastic energy [J]: Σ w ψ(F) over the quadrature points, with the remedies against locking.
    pub fn elastic_energy(&self) -> f64 {
        if let Some(model) = self.dynamics.model() {
            return model.energy_with(&self.state.x, &self.state.viscous);
        }
        self.space.energy(&self.material, &self.state.x)
    }

    /// Σ w det F, the present volume [m³].
    pub fn volume(&self) -> f64 {
        let mut volume = 0.0;
        self.space.for_points(&self.state.x, &mut |point| volume += point.weight * point.F.determinant());
        volume
    }

    /// Smallest det F of any quadrature point [1]; linear tetrahedra have one per piece. ≤ 0 means inverted.
    pub fn least_volume_ratio(&self) -> f64 {
        let mut least = f64::INFINITY;
        self.space.for_points(&self.state.x, &mut |point| least = least.min(point.F.determinant()));
        least
    }

    /// Cauchy stress P Fᵀ / det F of every element [Pa], averaged over its quadrature points; 0 where it is
    /// flat or inverted. Pieces of linear tetrahedra are elements of their own;
    /// [`solid`](Self::solid) and [`for_pieces`](Self::for_pieces) tell the element of every part.
    pub fn cauchy_stresses(&self) -> Vec<Matrix3<f64>> {
        let law = self.material.law;
        let mut of_element: Vec<(Matrix3<f64>, f64)> = Vec::new();
        let prony = &self.settings.prony;
        let mut springs = self.state.viscous.chunks_exact(prony.len().max(1));
        self.space.for_points(&self.state.x, &mut |point| {
            of_element.resize(point.element + 1, (Matrix3::zeros(), 0.0));
            let relaxing = springs.next();
            let J = point.F.determinant();
            if J > 1e-9 {
                let lame = self.space.lame(point.region, &self.material);
                let mut P = law.stress(&point.F, lame) + self.settings.fibres.stress(law, &point.F);
                if let Some(d) = relaxing {
                    P += first_piola(law, &point.F, &(2.0 * lame.mu * matrix(&prony.sum(d))));
                }
                of_element[point.element].0 += point.weight * (P * point.F.transpose() / J);
            }
            of_element[point.element].1 += point.weight;
        });
        of_element.into_iter().map(|(sum, weight)| sum / weight).collect()
    }

    /// The discrete model of the present topology, in double precision, whatever way steps are solved.
    ///
    /// # Errors
    /// Settings for which there is none.
    pub fn discrete_model(&self) -> Result<Model, BodyError> {
        let model = self.space.model(&self.material, self.settings.volumetric)?;
        let mut model = model.with_fibres(self.settings.fibres)?.with_prony(self.settings.prony)?;
        model.begin_viscous(&mut Team::alone(), 0.0, &self.state.x, &self.state.viscous);
        Ok(model)
    }

    /// Region of the material of every element, numbered as in [`cauchy_stresses`](Self::cauchy_stresses): 0 for the
    /// material of the body.
    pub fn element_regions(&self) -> Vec<u16> {
        let mut of_element = Vec::new();
        self.space.for_points(&self.state.x, &mut |point| {
            of_element.resize(point.element + 1, 0);
            of_element[point.element] = point.region;
        });
        of_element
    }

    /// Estimates the discretisation error of linear tetrahedra, cut or not; `None` for other elements and for bodies with
    /// fibres or viscoelasticity.
    pub fn mesh_error(&self, recovery: &mut StressRecovery) -> Option<MeshError> {
        let plain = self.settings.fibres.is_empty() && self.settings.prony.is_empty();
        let tets = self.space.tets().filter(|tets| tets.is_linear() && plain)?;
        let tets = CutTets::new(tets.mesh(), tets.pieces(), self.n_copies(), tets.regions());
        Some(recovery.estimate(&tets, &self.state.x, self.material.law, self.material.lame()))
    }

    /// Estimates the discretisation error of the cells of an octree; `None` for other elements. The error of every
    /// cell, which [`adapt`](Self::adapt) takes, stays in `recovery`.
    pub fn cell_error(&self, recovery: &mut CellRecovery) -> Option<MeshError> {
        let octree = self.space.octree()?.octree();
        Some(recovery.estimate(octree, &self.state.x, &self.material))
    }

    /// Internal force on every node [N]; it pulls the body back, so it is subtracted from the loads.
    pub fn internal_forces(&self) -> Vec<Vector3<f64>> {
        let mut f_int = vec![Vector3::zeros(); self.state.x.len()];
        match self.dynamics.model() {
            Some(model) => model.internal_forces(&self.state.x, &mut f_int),
            None => self.space.elastic_forces(&self.material, &self.state.x, &mut f_int),
        };
        f_int
    }

    /// Sum of the forces [N] that hold the prescribed directions of `nodes` against elasticity, gravity
    /// [m/s²] and loads, without the inertia of the nodes themselves. Where a cut passes exactly through
    /// a held node, each lip has a held copy of it: all of them count.
    pub fn reaction(&self, nodes: &[u32], gravity: Vector3<f64>) -> Vector3<f64> {
        self.reactions(std::iter::once(nodes), gravity).into_iter().sum()
    }

    /// [`reaction`](Self::reaction) of every one of some groups of nodes.
    pub fn reactions<'a>(
        &self,
        groups: impl Iterator<Item = &'a [u32]>,
        gravity: Vector3<f64>,
    ) -> Vec<Vector3<f64>> {
        let mut f_int = self.internal_forces();
        if self.pressure_is_implicit() {
            f_int.iter_mut().zip(self.pressure_forces()).for_each(|(f, pressure)| *f -= pressure);
        }
        let held_by = |nodes: &[u32]| {
            let mut sum = Vector3::zeros();
            for fixed in self.fixed.iter().filter(|f| nodes.contains(&self.space.node_of(f.copy))) {
                let c = fixed.copy as usize;
                let held = f_int[c] - self.weight(c, gravity) - self.load[c];
                sum += fixed.held.part_of(&held);
            }
            sum
        };
        groups.map(held_by).collect()
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
        self.dynamics.solver().weight(c, self.mass[c], gravity)
    }

    fn weighted(&self, values: &[Vector3<f64>]) -> Vector3<f64> {
        self.mass.iter().zip(values).map(|(m, v)| *m * v).sum()
    }
}

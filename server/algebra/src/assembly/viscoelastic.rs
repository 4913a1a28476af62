//! Viscoelasticity of a model.
//!
//! The strains dᵢ of the springs belong to the state of the body: per element and quadrature point one for every term.
//! A step [begins](Model::begin_viscous) with what is left of them at its end, acts as one spring per point, and
//! [ends](Model::end_viscous) with their new values. See [`Prony`].

use nalgebra::Vector3;
use scindo_matter::material::{Prony, Strain};
use scindo_matter::team::{Team, blocks};

use super::viscous::Viscous;
use super::{Model, ModelError};

/// Quadrature points per task.
const CHUNK: usize = 128;

impl Model {
    /// Puts the terms of a Prony series beside the law, with springs at rest.
    ///
    /// # Errors
    /// A constant of them out of range.
    pub fn with_prony(mut self, prony: Prony) -> Result<Self, ModelError> {
        prony.check()?;
        self.viscous = Viscous { prony, ..Viscous::default() };
        self.resize_viscous();
        Ok(self)
    }

    /// Terms of a Prony series in all elements.
    pub fn prony(&self) -> &Prony {
        &self.viscous.prony
    }

    /// Number of strains that a body of this model keeps: quadrature points times terms.
    pub fn n_strains(&self) -> usize {
        self.weights.len() * self.viscous.prony.len()
    }

    /// Makes room for the springs of the present elements.
    pub fn resize_viscous(&mut self) {
        let points = if self.viscous.prony.is_empty() { 0 } else { self.weights.len() };
        self.viscous.start.clear();
        self.viscous.start.resize(points, [0.0; 6]);
    }

    /// Begins a step of `h` [s] from the positions `x` [m] with the strains `d` of the springs. With h = 0 forces at `x`
    /// are those of the springs as they are. Another number of strains is ignored: the springs then stay at rest.
    pub fn begin_viscous(&mut self, team: &mut Team, h: f64, x: &[Vector3<f64>], d: &[Strain]) {
        let terms = self.viscous.prony.len();
        if terms == 0 || d.len() != self.n_strains() {
            return;
        }
        let mut start = std::mem::take(&mut self.viscous.start);
        let (model, prony) = (&*self, self.viscous.prony);
        team.for_blocks(blocks(&mut start, CHUNK), |chunk, starts| {
            for (point, start) in (chunk * CHUNK..).zip(starts) {
                *start = prony.start(h, &model.strain(point, x), &d[point * terms..][..terms]);
            }
        });
        self.viscous.start = start;
        self.viscous.stiffness = prony.stiffness(h);
    }

    /// Ends a step of `h` [s] from the positions `before` to `after` [m]: moves the strains `d` of the springs on.
    pub fn end_viscous(
        &self,
        team: &mut Team,
        h: f64,
        (before, after): (&[Vector3<f64>], &[Vector3<f64>]),
        d: &mut [Strain],
    ) {
        let (prony, terms) = (&self.viscous.prony, self.viscous.prony.len());
        if terms == 0 || d.len() != self.n_strains() {
            return;
        }
        team.for_blocks(blocks(d, CHUNK * terms), |chunk, d| {
            for (point, d) in (chunk * CHUNK..).zip(d.chunks_exact_mut(terms)) {
                let mut growth = self.strain(point, after);
                growth.iter_mut().zip(self.strain(point, before)).for_each(|(growth, e)| *growth -= e);
                prony.advance(h, &growth, d);
            }
        });
    }

    /// Elastic energy \[J\] at the positions `x` [m], with springs that have the strains `d`.
    pub fn energy_with(&self, x: &[Vector3<f64>], d: &[Strain]) -> f64 {
        self.energy(x) + self.viscous_excess(x, d)
    }

    /// [`energy_with`](Self::energy_with) on all threads of a team.
    pub fn energy_with_by(&self, team: &mut Team, x: &[Vector3<f64>], d: &[Strain]) -> f64 {
        self.energy_by(team, x) + self.viscous_excess(x, d)
    }

    /// Energy \[J\] of springs with the strains `d`, less that of the springs that stand for them in the present step.
    fn viscous_excess(&self, x: &[Vector3<f64>], d: &[Strain]) -> f64 {
        let (prony, Q) = (&self.viscous.prony, self.kind.points());
        let terms = prony.len();
        if terms == 0 || d.len() != self.n_strains() {
            return 0.0;
        }
        let excess = |point: usize| {
            let law = self.point_of(point / Q);
            let F = self.deformation_gradient(point / Q, point % Q, x);
            let in_step = self.viscous.spring(point, law.lame.mu).energy(law.law, &F);
            self.weights[point] * (prony.stored(law.lame.mu, &d[point * terms..][..terms]) - in_step)
        };
        (0..self.weights.len()).map(excess).sum()
    }

    fn strain(&self, point: usize, x: &[Vector3<f64>]) -> Strain {
        let Q = self.kind.points();
        Prony::strain(self.point.law, &self.deformation_gradient(point / Q, point % Q, x))
    }
}

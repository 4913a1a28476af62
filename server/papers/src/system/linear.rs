//! The linear system of a step, A u = b, at rest: operator in single precision, residuals in double precision.
//!
//! A = M + Δt² K for a step from rest, and K for an equilibrium. Its stiffness number is s = E Δt²/(ρ h²), with h
//! the side of a finest cell: the ratio of the two terms.

use std::time::Instant;

use nalgebra::{Matrix3, Vector3};
use scindo_physics::element::FixedCopy;
use scindo_physics::element::{Points, Simd};
use scindo_physics::material::{Law, Material, Rayleigh, Region};
use scindo_physics::octree::Octree;
use scindo_physics::operator::cells::CellStiffness;
use scindo_physics::operator::{BLOCK, BlockJacobi, ElasticUpdate, Padded, Stiffness, SystemOperator};
use scindo_physics::solver::multigrid::{
    CellMaterial, Coefficients, Hierarchy, Multigrid, MultigridSettings, Smoother,
};
use scindo_physics::team::{Team, blocks};
use scindo_study::words::compact;

use super::model::{Held, Pull};
use crate::lab::Trouble;

type V = Vector3<f64>;

/// Constants of all bodies. The paper prints none; only the stiffness number matters to a solver.
pub const MATERIAL: Material = Material {
    young_pa: 1e5,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Linear,
};

/// The smoother of the paper: one sweep before and after, ω = 1.7.
pub const PAPERS: Smoother = Smoother::GaussSeidel { sweeps: 1, omega: 1.7 };

/// The smoothers that are compared, with their names.
pub fn smoothers() -> [(&'static str, Smoother); 2] {
    [("SOR", PAPERS), ("Chebyshev", Smoother::default())]
}

/// Seconds that the parts of bringing a system up to date take.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds {
    /// Rotations, forces and diagonal blocks of the finest level.
    pub operator: f64,
    /// Hierarchy: cells, vertices and transfers of all levels. Only after a cut.
    pub levels: f64,
    /// Operators of the coarse levels, where their memory is in use already.
    pub coarse: f64,
    /// Largest eigenvalues for the smoothers of all levels. Only after a cut, or with another step or material.
    pub eigenvalues: f64,
}

/// How often parts of a step are timed.
pub const TIMES: usize = 7;

/// The least of [several](TIMES) durations [s]: other work on the machine only makes them longer.
fn fastest(mut duration: impl FnMut() -> f64) -> f64 {
    (0..TIMES).map(|_| duration()).fold(f64::INFINITY, f64::min)
}

/// A x = b of a body.
#[derive(Debug)]
pub struct System {
    octree: Octree,
    rest: Vec<V>,
    /// Prescribed directions.
    pub fixed: Vec<FixedCopy>,
    mass: Vec<f64>,
    mass_f32: Vec<f32>,
    /// Factors of M and of K in A.
    factors: [f64; 2],
    material: Material,
    stiffness: CellStiffness,
    jacobi: BlockJacobi,
    /// Diagonal blocks of the last update.
    diagonal: Vec<[f32; 8]>,
    /// The right-hand side in double precision.
    b: Vec<V>,
    /// Factor by which loads, and so solutions, are smaller than those of the problem.
    scale: f64,
    /// One thread, as in the paper.
    pub team: Team,
}

/// What kind of problem a system is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Problem {
    /// The first time step, with this stiffness number s.
    Step(f64),
    /// An equilibrium: no mass.
    Equilibrium,
}

impl Problem {
    /// Name in tables.
    pub fn words(self) -> String {
        match self {
            Self::Step(s) => format!("s = {}", compact(s)),
            Self::Equilibrium => "no mass".to_owned(),
        }
    }
}

impl System {
    /// The system of a body of `octree` as it is cut now; `held` and `pull` as in a [model](super::model::Model).
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn new(octree: &Octree, (held, pull): (Held, Pull), problem: Problem) -> Result<Self, Trouble> {
        Self::of_material(octree, (held, pull), problem, MATERIAL)
    }

    /// The same of another linear material.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn of_material(
        octree: &Octree,
        (held, pull): (Held, Pull),
        problem: Problem,
        material: Material,
    ) -> Result<Self, Trouble> {
        let rest = octree.rest_positions();
        let h = octree.lattice().h;
        let factors = match problem {
            Problem::Step(s) => [1.0, s * material.density_kg_m3 * h * h / material.young_pa],
            Problem::Equilibrium => [0.0, 1.0],
        };
        let mass = octree.vertex_masses(material.density_kg_m3);
        let fixed: Vec<FixedCopy> = (0_u32..)
            .zip(&rest)
            .filter(|(_, X)| held(X))
            .map(|(copy, _)| FixedCopy { copy, held: [true; 3].into(), position_m: [0.0; 3] })
            .collect();
        let mut b: Vec<V> = mass.iter().zip(&rest).map(|(m, X)| factors[1] * *m * pull(X)).collect();
        hold(&fixed, &mut b);
        // Within the range of single precision, whatever the units are.
        let scale = 1.0 / norm(&b).max(f64::MIN_POSITIVE);
        b.iter_mut().for_each(|b| *b *= scale);
        let lame: Vec<_> = octree.regions().iter().map(Region::lame).collect();
        let stiffness = CellStiffness::new(Simd::detect(), octree, &lame);
        let mut jacobi = BlockJacobi::default();
        jacobi.resize(rest.len());
        let mass_f32 = mass.iter().map(|m| *m as f32).collect();
        let mut system = Self {
            octree: octree.clone(),
            rest,
            fixed,
            mass,
            mass_f32,
            factors,
            material,
            stiffness,
            jacobi,
            diagonal: Vec::new(),
            b,
            scale,
            team: Team::new(1)?,
        };
        system.update();
        Ok(system)
    }

    /// Brings the finest level up to date: rotations, forces and diagonal blocks. Returns the seconds that this takes
    /// in a running simulation, where all memory is in use already.
    pub fn update(&mut self) -> f64 {
        self.bring_up_to_date();
        fastest(|| {
            let started = Instant::now();
            self.bring_up_to_date();
            started.elapsed().as_secs_f64()
        })
    }

    fn bring_up_to_date(&mut self) {
        let [mass_factor, scale] = self.factors;
        let with = ElasticUpdate { lame: self.material.lame(), law: Law::Corotational, scale };
        self.stiffness.update(&mut self.team, &with, &self.rest, None);
        self.diagonal.resize(self.rest.len(), [0.0; 8]);
        let (K, mass) = (&self.stiffness, &self.mass_f32);
        self.team.for_blocks(blocks(&mut self.diagonal, BLOCK), |block, diagonal| {
            K.diagonals(block, diagonal);
            for (d, m) in diagonal.iter_mut().zip(&mass[block * BLOCK..]) {
                [0, 4, 6].into_iter().for_each(|k| d[k] += mass_factor as f32 * m);
            }
        });
        self.jacobi.update(&mut self.team, &self.diagonal, &self.fixed);
    }

    /// Bytes of the finest level: kernels, state in double precision, and vectors of conjugate gradients.
    pub fn memory(&self) -> usize {
        let vertex = size_of::<V>() * 4 + size_of::<Padded>() * 5 + size_of::<[f32; 8]>() + 12;
        self.octree.bytes() + self.stiffness.memory() + vertex * self.rest.len()
    }

    /// The cells.
    pub fn octree(&self) -> &Octree {
        &self.octree
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        3 * self.rest.len()
    }

    /// The right-hand side, rounded.
    pub fn right_hand_side(&self) -> Vec<Padded> {
        self.b.iter().map(|b| [b.x as f32, b.y as f32, b.z as f32, 0.0]).collect()
    }

    /// Factors of M and of K in A.
    pub fn factors(&self) -> [f64; 2] {
        self.factors
    }

    /// Lumped masses [kg].
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// The material of cells outside regions.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Factor by which solutions are smaller than the displacements [m] under the pull.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The right-hand side.
    pub fn load(&self) -> &[V] {
        &self.b
    }

    /// Multigrid with this smoother, and the seconds that its levels and operators took.
    pub fn multigrid(&mut self, smoother: Smoother) -> (Multigrid, Seconds) {
        self.multigrid_with(MultigridSettings { smoother, ..MultigridSettings::default() })
    }

    /// The same with other settings.
    pub fn multigrid_with(&mut self, settings: MultigridSettings) -> (Multigrid, Seconds) {
        self.multigrid_on(Hierarchy::new, settings)
    }

    /// The same with another way to make the levels.
    pub fn multigrid_on(
        &mut self,
        levels: impl Fn(&Octree) -> Hierarchy,
        settings: MultigridSettings,
    ) -> (Multigrid, Seconds) {
        let started = Instant::now();
        let mut multigrid = Multigrid::new(levels(&self.octree), settings);
        let levels = started.elapsed().as_secs_f64();
        let material =
            |region: &Region| CellMaterial { lame: region.lame(), density_kg_m3: region.density_kg_m3 };
        let own = CellMaterial { lame: self.material.lame(), density_kg_m3: self.material.density_kg_m3 };
        let materials = [own].into_iter().chain(self.octree.regions().iter().map(material)).collect();
        let [mass_factor, scale] = self.factors;
        let with = Coefficients { materials, scale, mass_factor };
        // Matrices of another step, so that all of these are new while their memory is in use, as in a running
        // simulation.
        let other = Coefficients { scale: 1.5 * scale, ..with.clone() };
        let coarse = fastest(|| {
            multigrid.update(&mut self.team, (&other, &self.fixed), &|_| Matrix3::identity());
            let started = Instant::now();
            multigrid.update(&mut self.team, (&with, &self.fixed), &|_| Matrix3::identity());
            started.elapsed().as_secs_f64()
        });
        let started = Instant::now();
        if let Smoother::Chebyshev { .. } = settings.smoother {
            let (mut A, jacobi, team) = self.parts();
            multigrid.estimate_eigenvalues(team, &mut A, jacobi.inverses());
        }
        let eigenvalues = started.elapsed().as_secs_f64();
        (multigrid, Seconds { operator: 0.0, levels, coarse, eigenvalues })
    }

    /// A, its block-diagonal preconditioner, and the thread.
    pub fn parts(&mut self) -> (SystemOperator<'_>, &mut BlockJacobi, &mut Team) {
        let A = SystemOperator {
            elastic: &mut self.stiffness,
            mass: &self.mass_f32,
            mass_factor: self.factors[0] as f32,
            springs: &[],
            fixed: &self.fixed,
        };
        (A, &mut self.jacobi, &mut self.team)
    }

    /// b − A u in double precision.
    pub fn residual(&self, u: &[V]) -> Vec<V> {
        let x: Vec<V> = self.rest.iter().zip(u).map(|(X, u)| X + u).collect();
        let mut r = vec![V::zeros(); u.len()];
        self.octree.elastic_forces(&self.material, &x, &mut r);
        for (i, r) in r.iter_mut().enumerate() {
            *r = self.b[i] - self.factors[0] * self.mass[i] * u[i] - self.factors[1] * *r;
        }
        hold(&self.fixed, &mut r);
        r
    }
}

/// Sets the prescribed directions of `v` to 0.
pub fn hold(fixed: &[FixedCopy], v: &mut [V]) {
    for f in fixed {
        f.held.clear(&mut v[f.copy as usize]);
    }
}

/// √Σ|v|².
pub fn norm(v: &[V]) -> f64 {
    v.iter().map(V::norm_squared).sum::<f64>().sqrt()
}

//! Bodies and runs that several tests share.

use nalgebra::Vector3;
use scindo_physics::assembly::pressure::Pressure;
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::element::FixedCopy;
use scindo_physics::integrator::{
    Dynamics, DynamicsSettings, LooseParts, MassKind, Outcome, Scheme, SolveReport, State, StepInputs,
    omega_max,
};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::solver::{LinearSettings, Method, NewtonSettings, Precision};
use scindo_physics::team::Team;

pub(crate) type V = Vector3<f64>;

pub(crate) fn material(law: Law, young_pa: f64, poisson: f64, density_kg_m3: f64) -> Material {
    Material { young_pa, poisson, density_kg_m3, rayleigh: Rayleigh::default(), law }
}

/// A box of five-tet cells with its corner at the origin.
pub(crate) fn tet_box(size: [f64; 3], cells: [usize; 3], material: &Material) -> Model {
    let mesh = box_mesh(V::zeros(), size.into(), cells, BoxPattern::Tet5 { parity: false });
    Model::tet4(&mesh, material, Volumetric::Full).unwrap()
}

/// Nodes at rest with coordinate 0 along `axis`, held where they are.
pub(crate) fn held_at_zero(model: &Model, axis: usize) -> Vec<FixedCopy> {
    let at_zero = |(i, x): (usize, &V)| {
        (x[axis].abs() < 1e-12).then(|| FixedCopy {
            copy: i as u32,
            held: [true; 3].into(),
            position_m: (*x).into(),
        })
    };
    model.rest().iter().enumerate().filter_map(at_zero).collect()
}

/// Newton's method as far as double precision goes, each step solved directly.
pub(crate) fn accurate(scheme: Scheme, mass: MassKind) -> DynamicsSettings {
    let linear = LinearSettings {
        method: Method::Cholesky,
        precision: Precision::Double,
        iterations: 10,
        tolerance: 1e-10,
    };
    let newton = NewtonSettings { steps: 30, tolerance: 1e-12, linear, ..NewtonSettings::default() };
    DynamicsSettings { scheme, mass, newton, ..DynamicsSettings::default() }
}

/// A body on its way, alone in the world.
pub(crate) struct Run {
    pub dynamics: Dynamics,
    pub model: Model,
    pub settings: DynamicsSettings,
    pub masses: Vec<f64>,
    density_kg_m3: f64,
    pub state: State,
    pub fixed: Vec<FixedCopy>,
    pub load: Vec<V>,
    pub gravity: V,
    pub team: Team,
    pub reports: Vec<SolveReport>,
}

impl Run {
    pub(crate) fn new(model: Model, material: Material, settings: DynamicsSettings) -> Self {
        let n = model.n_nodes();
        let state = State { x: model.rest().to_vec(), v: vec![V::zeros(); n], viscous: Vec::new() };
        Self {
            masses: model.lumped_mass(material.density_kg_m3),
            density_kg_m3: material.density_kg_m3,
            dynamics: Dynamics::of_model(model.clone(), material, settings).unwrap(),
            model,
            settings,
            state,
            fixed: Vec::new(),
            load: vec![V::zeros(); n],
            gravity: V::zeros(),
            team: Team::new(1).unwrap(),
            reports: Vec::new(),
        }
    }

    /// Spins about the centre of mass.
    pub(crate) fn spin(&mut self, omega: V) {
        let centre = self.centre_of_mass();
        for (v, x) in self.state.v.iter_mut().zip(&self.state.x) {
            *v = omega.cross(&(x - centre));
        }
    }

    pub(crate) fn step(&mut self, h: f64) -> SolveReport {
        let Self { dynamics, model, masses: mass, state, fixed, load, gravity, team, .. } = self;
        let parts = &LooseParts::connected(|visit| model.for_groups(visit), mass, fixed);
        let (gravity, rest) = (*gravity, model.rest());
        let pressure = Pressure::none();
        let inputs = StepInputs {
            h,
            gravity,
            mass,
            load,
            pressure,
            fixed,
            parts,
            springs: &[],
            rest,
            points: &*model,
        };
        let report = dynamics.step(team, state, &inputs, &mut Vec::new());
        assert!(state.x.iter().chain(&state.v).all(|c| c.iter().all(|c| c.is_finite())));
        self.reports.push(report);
        report
    }

    /// Steps that must all advance.
    pub(crate) fn steps(&mut self, h: f64, steps: usize) {
        for _ in 0..steps {
            let report = self.step(h);
            assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
        }
    }

    pub(crate) fn energy(&self) -> f64 {
        self.kinetic_energy(&self.state.v) + self.model.energy(&self.state.x)
    }

    /// ½ vᵀ M v.
    pub(crate) fn kinetic_energy(&self, v: &[V]) -> f64 {
        self.dynamics.solver().kinetic_energy(&self.masses, v)
    }

    /// ω_max at `x`.
    pub(crate) fn omega_max(&mut self, x: &[V], fixed: &[FixedCopy]) -> f64 {
        omega_max(&mut self.team, &self.model, (self.density_kg_m3, self.settings.mass), x, fixed)
    }

    pub(crate) fn centre_of_mass(&self) -> V {
        let mass = &self.masses;
        let moment: V = self.state.x.iter().zip(mass).map(|(x, m)| *m * x).sum();
        moment / mass.iter().sum::<f64>()
    }

    pub(crate) fn momentum(&self) -> V {
        self.state.v.iter().zip(&self.masses).map(|(v, m)| *m * v).sum()
    }

    /// About the origin, with lumped masses.
    pub(crate) fn angular_momentum(&self) -> V {
        let State { x, v, .. } = &self.state;
        self.masses.iter().zip(x).zip(v).map(|((m, x), v)| *m * x.cross(v)).sum()
    }
}

//! The general path in time: contacts, prescribed motion, fragments, guards, determinism, memory.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::assembly::pressure::Pressure;
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::body::{PointSpring, SpringKind};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::element::FixedCopy;
use scindo_physics::element::MaterialPoint;
use scindo_physics::integrator::{
    Dynamics, DynamicsSettings, LooseParts, MassKind, Notice, Outcome, Scheme, SolveReport, State, StepInputs,
};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};
use scindo_physics::solver::{LinearSettings, Method, NewtonSettings};
use scindo_physics::team::Team;

use crate::{DOWN, SOFT, cube, settings as fast_settings};

type V = Vector3<f64>;

const DYNAMIC: [Scheme; 7] = [
    Scheme::SymplecticEuler,
    Scheme::Midpoint,
    Scheme::Rk4,
    Scheme::ImplicitEuler,
    Scheme::Bdf2,
    Scheme::AVERAGE_ACCELERATION,
    Scheme::GeneralisedAlpha { spectral_radius: 0.8 },
];

/// A body with its loads.
struct Rig {
    dynamics: Dynamics,
    model: Model,
    masses: Vec<f64>,
    parts: LooseParts,
    /// Prescribed nodes for which the parts were found.
    known: Option<Vec<FixedCopy>>,
    state: State,
    team: Team,
    load: Vec<V>,
    fixed: Vec<FixedCopy>,
    springs: Vec<PointSpring>,
    forces: Vec<V>,
    gravity: V,
}

impl Rig {
    fn new(model: Model, material: Material, settings: DynamicsSettings) -> Self {
        let n = model.n_nodes();
        Self {
            state: State { x: model.rest().to_vec(), v: vec![V::zeros(); n], viscous: Vec::new() },
            masses: model.lumped_mass(material.density_kg_m3),
            dynamics: Dynamics::of_model(model.clone(), material, settings).unwrap(),
            model,
            parts: LooseParts::default(),
            known: None,
            team: Team::new(1).unwrap(),
            load: vec![V::zeros(); n],
            fixed: Vec::new(),
            springs: Vec::new(),
            forces: Vec::new(),
            gravity: DOWN,
        }
    }

    fn cube(material: Material, settings: DynamicsSettings) -> Self {
        let mesh = box_mesh(V::zeros(), V::repeat(0.1), [2; 3], BoxPattern::Tet6);
        Self::new(Model::tet4(&mesh, &material, Volumetric::Full).unwrap(), material, settings)
    }

    fn step(&mut self, h: f64) -> SolveReport {
        if self.known.as_ref() != Some(&self.fixed) {
            self.parts =
                LooseParts::connected(|visit| self.model.for_groups(visit), &self.masses, &self.fixed);
            self.known = Some(self.fixed.clone());
        }
        let inputs = StepInputs {
            h,
            gravity: self.gravity,
            mass: &self.masses,
            load: &self.load,
            pressure: Pressure::none(),
            fixed: &self.fixed,
            parts: &self.parts,
            springs: &self.springs,
            rest: self.model.rest(),
            points: &self.model,
        };
        self.dynamics.step(&mut self.team, &mut self.state, &inputs, &mut self.forces)
    }

    fn momentum(&self) -> V {
        self.state.v.iter().zip(&self.masses).map(|(v, m)| *m * v).sum()
    }

    fn mass(&self) -> f64 {
        self.masses.iter().sum()
    }

    /// One-sided springs under the lowest nodes.
    fn floor(&mut self, height: f64, stiffness_n_m: f64) {
        let rest = self.model.rest();
        self.springs = (0..rest.len())
            .filter(|&n| rest[n].y == 0.0)
            .map(|n| PointSpring {
                point: MaterialPoint::new([(n as u32, 1.0)]),
                kind: SpringKind::OneSided { normal: V::y(), offset_m: height },
                stiffness_n_m,
                max_force_n: 100.0,
            })
            .collect();
    }

    fn clamp(&mut self) {
        let at_zero = |(n, x): (usize, &V)| {
            (x.x == 0.0).then(|| FixedCopy {
                copy: n as u32,
                held: [true; 3].into(),
                position_m: (*x).into(),
            })
        };
        self.fixed = self.model.rest().iter().enumerate().filter_map(at_zero).collect();
    }
}

fn with(scheme: Scheme) -> DynamicsSettings {
    DynamicsSettings { scheme, ..DynamicsSettings::default() }
}

#[test]
fn a_body_comes_to_rest_on_a_floor_with_every_scheme_and_mass() {
    let damped = Material { rayleigh: Rayleigh { mass_1_s: 20.0, stiffness_s: 1e-3 }, ..SOFT };
    for scheme in DYNAMIC {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            if mass == MassKind::Consistent
                && !matches!(scheme, Scheme::SymplecticEuler | Scheme::ImplicitEuler)
            {
                continue;
            }
            let mut rig = Rig::cube(damped, DynamicsSettings { mass, ..with(scheme) });
            rig.floor(-0.01, 200.0);
            for _ in 0..200 {
                let report = rig.step(0.005);
                assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
                assert!(rig.forces.iter().all(|f| f.y >= 0.0), "a floor does not pull");
            }
            let push: V = rig.forces.iter().sum();
            let weight = rig.mass() * DOWN;
            assert!((push + weight).norm() < 1e-3 * weight.norm(), "{scheme:?} {mass:?}: {push} {weight}");
        }
    }
}

#[test]
fn a_contact_exchanges_momentum_exactly() {
    let mut rig = Rig::cube(SOFT, with(Scheme::ImplicitEuler));
    rig.floor(-0.005, 500.0);
    for _ in 0..100 {
        let before = rig.momentum();
        rig.step(0.005);
        let push: V = rig.forces.iter().sum();
        let missing = rig.momentum() - before - 0.005 * (push + rig.mass() * DOWN);
        assert!(missing.norm() < 1e-7, "{missing}");
    }
}

#[test]
fn bdf2_starts_over_at_contact_onset_and_after_a_change_of_state() {
    let mut rig = Rig::cube(SOFT, with(Scheme::Bdf2));
    rig.floor(-0.01, 200.0);
    let notices: Vec<_> = (0..12).map(|_| rig.step(0.01).notice).collect();
    assert_eq!(notices[0], Some(Notice::Started));
    assert_eq!(notices.iter().filter(|n| **n == Some(Notice::ContactOnset)).count(), 1, "{notices:?}");
    rig.state.v[3].x += 0.1;
    assert_eq!(rig.step(0.01).notice, Some(Notice::Started));
    assert_eq!(rig.step(0.005).notice, Some(Notice::Started), "another step length");
}

#[test]
fn prescribed_nodes_arrive_where_they_should() {
    for scheme in DYNAMIC.into_iter().chain([Scheme::Static]) {
        let mut rig = Rig::cube(SOFT, with(scheme));
        rig.clamp();
        let h = 0.002;
        for k in 1..=20 {
            let rest = rig.model.rest().to_vec();
            for f in &mut rig.fixed {
                f.position_m[1] = rest[f.copy as usize].y + 0.5 * h * f64::from(k);
            }
            assert_eq!(rig.step(h).outcome, Outcome::Advanced);
            for f in &rig.fixed {
                let c = f.copy as usize;
                assert!((rig.state.x[c] - V::from(f.position_m)).norm() < 1e-15, "{scheme:?}");
                let expected = if scheme == Scheme::Static { 0.0 } else { 0.5 };
                // Schemes of second order oscillate about it after the jump at the start.
                let tolerance = if scheme.is_newmark() || scheme == Scheme::Bdf2 { 0.6 } else { 1e-9 };
                assert!((rig.state.v[c].y - expected).abs() < tolerance, "{scheme:?}: {}", rig.state.v[c]);
            }
        }
    }
}

/// Case 8: the free fragment of a cut body falls with g, beside the clamped one.
#[test]
fn fragments_fall_freely_with_every_scheme() {
    let mesh = box_mesh(V::zeros(), V::new(0.4, 0.1, 0.1), [8, 2, 2], BoxPattern::Tet6);
    let mut cut = CutMesh::new(mesh).unwrap();
    let segment = |y: f64| [V::new(0.1734, y, -0.05), V::new(0.1951, y, 0.15)];
    let x = cut.rest_positions();
    cut.sweep(&x, &BladeSweep { segments: vec![segment(-0.05), segment(0.15)] }, 1).unwrap();
    for scheme in DYNAMIC {
        for law in [Law::Corotational, Law::NeoHookean] {
            let material = Material { law, ..SOFT };
            let model = Model::tet4_cut(&cut, &material, Volumetric::Full).unwrap();
            let mut rig = Rig::new(model, material, with(scheme));
            rig.clamp();
            let h = 1e-3;
            for _ in 0..20 {
                rig.step(h);
            }
            let parts = &rig.parts;
            assert_eq!((parts.len(), parts.any_free()), (2, true));
            let free = (0..2).find(|&p| parts.free[p]).unwrap();
            let copies = || (0..rig.state.x.len()).filter(|&c| parts.of_copy[c] as usize == free);
            let mass = &rig.masses;
            let v: V = copies().map(|c| mass[c] * rig.state.v[c]).sum::<V>() / parts.mass[free];
            let error = (v - 20.0 * h * DOWN).norm() / (20.0 * h * DOWN.norm());
            assert!(error < 1e-9, "{scheme:?} {law:?}: {error:e}");
        }
    }
}

#[test]
fn static_steps_end_in_equilibrium_and_loose_bodies_are_refused() {
    let mut rig = Rig::cube(SOFT, with(Scheme::Static));
    let report = rig.step(0.01);
    assert_eq!((report.outcome, report.notice), (Outcome::Refused, Some(Notice::LooseBody)));
    rig.clamp();
    rig.step(0.01);
    let mut f = vec![V::zeros(); rig.state.x.len()];
    rig.model.internal_forces(&rig.state.x, &mut f);
    let loose = |c: usize| rig.fixed.iter().all(|f| f.copy as usize != c);
    let masses = &rig.masses;
    let out = (0..f.len()).filter(|&c| loose(c)).map(|c| (f[c] - masses[c] * DOWN).norm());
    assert!(out.fold(0.0, f64::max) < 1e-5 * rig.mass() * DOWN.norm());
    assert!(rig.state.v.iter().all(|v| *v == V::zeros()));
}

/// One solve from the predictor is what the fast path does, in single precision and matrix-free.
#[test]
fn the_fast_path_agrees() {
    let material = Material { rayleigh: Rayleigh { mass_1_s: 0.5, stiffness_s: 1e-3 }, ..SOFT };
    let mut body = cube(2, material, fast_settings(500, 1e-7));
    let newton = NewtonSettings { steps: 1, tolerance: 1e-8, ..DynamicsSettings::default().newton };
    let mut rig = Rig::cube(material, DynamicsSettings { newton, ..with(Scheme::ImplicitEuler) });
    rig.clamp();
    let clamped: Vec<u32> = rig.fixed.iter().map(|f| f.copy).collect();
    body.fix(&clamped, [true; 3], V::zeros()).unwrap();
    for _ in 0..50 {
        rig.step(0.01);
        body.step(0.01, DOWN, &[]);
    }
    let moved = rig.state.x.iter().zip(rig.model.rest()).map(|(x, r)| (x - r).norm()).fold(0.0, f64::max);
    let apart = rig.state.x.iter().zip(body.positions()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(apart < 1e-4 * moved, "{apart:e} of {moved:e}");
}

#[test]
fn nonsense_is_refused_and_nothing_becomes_infinite() {
    for scheme in DYNAMIC {
        let mut rig = Rig::cube(SOFT, with(scheme));
        let before = rig.state.clone();
        rig.load[5].x = f64::NAN;
        let report = rig.step(0.01);
        assert_eq!((report.outcome, report.notice), (Outcome::Refused, Some(Notice::BadInput)));
        rig.load[5].x = 0.0;
        for h in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(rig.step(h).outcome, Outcome::Refused);
        }
        assert_eq!(rig.state, before);
        // A velocity that no scheme can follow.
        rig.state.v[0] = V::repeat(1e14);
        for _ in 0..5 {
            rig.step(0.01);
            assert!(rig.state.x.iter().chain(&rig.state.v).all(|v| v.iter().all(|c| c.is_finite())));
        }
    }
}

#[test]
fn unusable_newmark_parameters_are_an_error() {
    let mesh = box_mesh(V::zeros(), V::repeat(0.1), [1; 3], BoxPattern::Tet6);
    let model = Model::tet4(&mesh, &SOFT, Volumetric::Full).unwrap();
    for (beta, gamma) in [(0.0, 0.5), (0.25, 0.4), (f64::NAN, 0.5), (0.25, f64::NAN)] {
        assert!(Dynamics::of_model(model.clone(), SOFT, with(Scheme::Newmark { beta, gamma })).is_err());
    }
}

#[test]
fn hexahedra_and_quadratic_tets_swing_as_linear_tets_do() {
    let mut material = SOFT;
    material.density_kg_m3 = 1000.0;
    let size = V::new(0.2, 0.1, 0.1);
    let tets = box_mesh(V::zeros(), size, [2, 1, 1], BoxPattern::Tet6);
    let hexes = box_hexes(V::zeros(), size, [4, 2, 2]);
    let swing = |model: Model, mass| {
        let mut rig =
            Rig::new(model, material, DynamicsSettings { mass, ..with(Scheme::AVERAGE_ACCELERATION) });
        rig.clamp();
        for _ in 0..20 {
            rig.step(0.004);
        }
        rig.state.x.iter().map(|x| x.y).fold(0.0, f64::min)
    };
    let quadratic = swing(Model::tet10(&tets, &material).unwrap(), MassKind::Consistent);
    let scaled = swing(Model::tet10(&tets, &material).unwrap(), MassKind::Lumped);
    let hexahedra = swing(Model::hex8(&hexes, &material, Volumetric::Selective).unwrap(), MassKind::Lumped);
    assert!(quadratic < -0.01 && (scaled / quadratic - 1.0).abs() < 0.05, "{quadratic} {scaled}");
    assert!((hexahedra / quadratic - 1.0).abs() < 0.2, "{quadratic} {hexahedra}");
}

/// Everything at once: contact, damping, a moving clamp.
fn busy(scheme: Scheme, mass: MassKind, method: Method, (cells, threads): ([usize; 3], usize)) -> Rig {
    let material = Material { rayleigh: Rayleigh { mass_1_s: 0.5, stiffness_s: 1e-3 }, ..SOFT };
    let mesh = box_mesh(V::zeros(), V::new(0.4, 0.1, 0.1), cells, BoxPattern::Tet6);
    let model = Model::tet4(&mesh, &material, Volumetric::Full).unwrap();
    let settings = with(scheme);
    let linear = LinearSettings { method, ..settings.newton.linear };
    let newton = NewtonSettings { linear, ..settings.newton };
    let mut rig = Rig::new(model, material, DynamicsSettings { mass, newton, ..settings });
    rig.team = Team::new(threads).unwrap();
    rig.clamp();
    rig.floor(-0.002, 50.0);
    rig
}

#[test]
fn every_scheme_gives_the_same_bits_on_any_number_of_threads() {
    // More nodes than one block of the vector loops has.
    let cells = [10, 4, 4];
    let cases = [
        (Scheme::SymplecticEuler, MassKind::Lumped),
        (Scheme::Rk4, MassKind::Consistent),
        (Scheme::ImplicitEuler, MassKind::Lumped),
        (Scheme::Bdf2, MassKind::Consistent),
        (Scheme::AVERAGE_ACCELERATION, MassKind::Lumped),
    ];
    for (scheme, mass) in cases {
        let end = |threads| {
            let mut rig = busy(scheme, mass, Method::Pcg, (cells, threads));
            for _ in 0..2 {
                rig.step(0.002);
            }
            rig.state
        };
        let one = end(1);
        assert!(one == end(2) && one == end(1), "{scheme:?} {mass:?}");
    }
}

#[test]
fn a_steady_general_step_does_not_allocate() {
    for (method, mass) in [(Method::Pcg, MassKind::Lumped), (Method::Cholesky, MassKind::Consistent)] {
        for scheme in DYNAMIC.into_iter().chain([Scheme::Static]) {
            let mut rig = busy(scheme, mass, method, ([4, 2, 2], 2));
            for _ in 0..4 {
                rig.step(0.002);
            }
            let before = allocations();
            for _ in 0..6 {
                rig.step(0.002);
            }
            assert_eq!(allocations() - before, 0, "{scheme:?} {method:?} {mass:?}");
        }
    }
}

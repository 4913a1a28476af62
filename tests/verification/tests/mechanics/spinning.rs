//! Hard cases 18 to 20 (`scindo stress --list`): free spin of a cube with implicit integration, over four decades of Δt.
//!
//! A cube of 0.1 m, 2×2×2 cells of six tets, corotational, without gravity or damping, spins for 2 s.

use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::integrator::{DynamicsSettings, Notice, Scheme};
use scindo_physics::material::{Law, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::solver::NewtonSettings;

use crate::bodies::{Run, V, material};

fn cube(law: Law, young_pa: f64, settings: DynamicsSettings, rayleigh: Rayleigh) -> Run {
    let mut material = material(law, young_pa, 0.3, 1000.0);
    material.rayleigh = rayleigh;
    let mesh = box_mesh(V::zeros(), V::repeat(0.1), [2; 3], BoxPattern::Tet6);
    Run::new(Model::tet4(&mesh, &material, Volumetric::Full).unwrap(), material, settings)
}

fn with(scheme: Scheme, steps: u32) -> DynamicsSettings {
    let default = DynamicsSettings::default();
    DynamicsSettings { scheme, newton: NewtonSettings { steps, ..default.newton }, ..default }
}

/// What a run of 2 s looked like, relative to its start.
struct Summary {
    most_energy: f64,
    energy: f64,
    angular_momentum: f64,
    /// Largest growth of the angular momentum in one step.
    growth: f64,
    /// Largest diagonal.
    size: f64,
    fallbacks: usize,
    steps: usize,
}

fn spin(mut run: Run, omega: f64, h: f64, seconds: f64) -> Summary {
    run.spin(V::new(0.0, 0.0, omega));
    let (energy, momentum) = (run.energy(), run.angular_momentum().norm());
    let diagonal = |run: &Run| (run.state.x[26] - run.state.x[0]).norm();
    let length = diagonal(&run);
    let scheme = run.settings.scheme;
    let steps = (seconds / h).round() as usize;
    let mut summary = Summary {
        most_energy: 1.0,
        energy: 1.0,
        angular_momentum: 1.0,
        growth: 0.0,
        size: 1.0,
        fallbacks: 0,
        steps,
    };
    for _ in 0..steps {
        run.steps(h, 1);
        summary.energy = run.energy() / energy;
        summary.most_energy = summary.most_energy.max(summary.energy);
        let now = run.angular_momentum().norm() / momentum;
        summary.growth = summary.growth.max(now - summary.angular_momentum);
        summary.angular_momentum = now;
        summary.size = summary.size.max(diagonal(&run) / length);
    }
    summary.fallbacks = run.reports.iter().filter(|r| r.scheme != scheme).count();
    assert!(run.momentum().norm() < 1e-12);
    summary
}

const STEPS: [f64; 7] = [1e-4, 1e-3, 5e-3, 2e-2, 4e-2, 0.1, 0.2];

/// Case 18 with implicit Euler: the energy is never above that of the start.
#[test]
fn implicit_euler_never_gains_energy() {
    let mut worst = 0.0_f64;
    for young in [1e4, 1e5, 1e6] {
        for omega in [10.0, 40.0] {
            for h in STEPS {
                let seconds = if h < 1e-3 { 0.02 } else { 2.0_f64.min(100.0 * h) };
                for newton in [1, 20] {
                    let run = cube(
                        Law::Corotational,
                        young,
                        with(Scheme::ImplicitEuler, newton),
                        Rayleigh::default(),
                    );
                    let s = spin(run, omega, h, seconds);
                    worst = worst.max(s.most_energy);
                    println!(
                        "case 18: E = {young:e}, ω = {omega}, h = {h}, {newton} Newton: energy at most {:.9}, \
                         at the end {:.4}, L {:.4}",
                        s.most_energy, s.energy, s.angular_momentum
                    );
                }
            }
        }
    }
    println!("case 18: largest energy of implicit Euler {worst:.12} of the start");
    assert!(worst <= 1.0 + 1e-9);
}

/// Case 18 with BDF2: where the cube turns too far per step Euler takes over, and nothing blows up.
#[test]
fn bdf2_is_guarded_at_large_steps() {
    for young in [1e4, 1e5, 1e6] {
        for omega in [10.0, 40.0] {
            for h in STEPS {
                let seconds = if h < 1e-3 { 0.02 } else { 2.0_f64.min(100.0 * h) };
                let run = cube(Law::Corotational, young, with(Scheme::Bdf2, 20), Rayleigh::default());
                let s = spin(run, omega, h, seconds);
                println!(
                    "case 18: BDF2, E = {young:e}, ω = {omega}, h = {h}: energy at most {:.6}, at the end {:.4}, \
                     Euler in {} of {} steps",
                    s.most_energy, s.energy, s.fallbacks, s.steps
                );
                assert!(s.most_energy <= 1.0101);
                assert!(s.fallbacks >= 1); // the first step
            }
        }
    }
}

/// Case 19.
#[test]
fn a_free_cube_keeps_its_size_and_its_angular_momentum_decays() {
    for omega in [10.0, 40.0] {
        for h in [5e-3, 2e-2] {
            // Stiff enough that the centrifugal load itself stretches it by little: 1.2 % at 40 rad/s for
            // 1e5 Pa.
            let young = if omega > 20.0 { 1e6 } else { 1e5 };
            let euler = cube(Law::Corotational, young, with(Scheme::ImplicitEuler, 20), Rayleigh::default());
            let s = spin(euler, omega, h, 2.0);
            println!(
                "case 19: Euler, ω = {omega}, h = {h}: L {:.4}, energy {:.4}, size at most {:.5}",
                s.angular_momentum, s.energy, s.size
            );
            assert!(s.growth <= 1e-9 && s.size < 1.01 && s.most_energy <= 1.0 + 1e-9);
        }
    }
    let s = spin(cube(Law::Corotational, 1e5, with(Scheme::Bdf2, 20), Rayleigh::default()), 10.0, 0.02, 2.0);
    println!(
        "case 19: BDF2, ω = 10, h = 0.02: L {:.4}, energy {:.4}, size at most {:.5}",
        s.angular_momentum, s.energy, s.size
    );
    assert!(s.angular_momentum >= 0.90 && s.size < 1.01 && s.most_energy <= 1.01);
}

/// Case 20: Newmark either runs or gives way to Euler and says so.
#[test]
fn newmark_is_guarded() {
    for omega in [10.0, 40.0] {
        for h in [5e-3, 2e-2, 4e-2] {
            for newton in [2, 20] {
                let run = cube(
                    Law::Corotational,
                    1e5,
                    with(Scheme::AVERAGE_ACCELERATION, newton),
                    Rayleigh::default(),
                );
                let s = spin(run, omega, h, 2.0);
                println!(
                    "case 20: Newmark, ω = {omega}, h = {h}, {newton} Newton: energy at most {:.4}, at the end \
                     {:.4}, Euler in {} of {} steps",
                    s.most_energy, s.energy, s.fallbacks, s.steps
                );
                assert!(s.most_energy <= 1.0101);
            }
        }
    }
}

/// A guard that steps in says so, in words and with the number.
#[test]
fn guards_report() {
    let mut run = cube(Law::Corotational, 1e5, with(Scheme::Bdf2, 20), Rayleigh::default());
    run.spin(V::new(0.0, 0.0, 40.0));
    assert_eq!(run.step(0.04).notice, Some(Notice::Started));
    let report = run.step(0.04);
    assert!(matches!(report.notice, Some(Notice::Spinning { angle_rad }) if angle_rad > 0.8), "{report:?}");
    assert_eq!(report.scheme, Scheme::ImplicitEuler);
    assert!(report.notice.unwrap().to_string().contains("rad per step"));
}

/// β K̂ turns with the material: it takes nothing from a translation and next to nothing from a spin,
/// while it stops vibrations.
#[test]
fn stiffness_damping_leaves_rigid_motion_alone() {
    let strong = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.05 };
    for scheme in [
        Scheme::ImplicitEuler,
        Scheme::Bdf2,
        Scheme::AVERAGE_ACCELERATION,
        Scheme::SymplecticEuler,
        Scheme::Rk4,
    ] {
        for law in [Law::Corotational, Law::StVenantKirchhoff, Law::NeoHookean] {
            // Explicit schemes pay for viscosity with short steps.
            let rayleigh =
                if scheme.is_explicit() { Rayleigh { stiffness_s: 2e-3, ..strong } } else { strong };
            let mut moving = cube(law, 1e5, with(scheme, 20), rayleigh);
            moving.state.v.fill(V::new(1.0, -2.0, 0.5));
            let before = moving.energy();
            moving.steps(2e-3, 20);
            let change = moving.energy() / before - 1.0;
            assert!(change.abs() < 1e-12, "{scheme:?} {law:?}: translation, {change:e}");

            let (h, seconds) = (2e-3, 0.2);
            let damped = spin(cube(law, 1e5, with(scheme, 20), rayleigh), 10.0, h, seconds);
            let free = spin(cube(law, 1e5, with(scheme, 20), Rayleigh::default()), 10.0, h, seconds);
            let lost = damped.angular_momentum / free.angular_momentum - 1.0;
            println!(
                "β K̂, {} {law:?}: L {:.6} with, {:.6} without; energy {:.6}, {:.6}",
                scheme.name(),
                damped.angular_momentum,
                free.angular_momentum,
                damped.energy,
                free.energy
            );
            assert!(lost.abs() < 2e-3, "{scheme:?} {law:?}: spin, {lost:e}");

            let mut ringing = cube(law, 1e5, with(scheme, 20), rayleigh);
            for (v, x) in ringing.state.v.iter_mut().zip(ringing.model.rest()) {
                *v = V::new(x.x - 0.05, 0.0, 0.0) * 4.0;
            }
            let before = ringing.energy();
            ringing.steps(2e-3, 50);
            assert!(ringing.energy() < 0.05 * before, "{scheme:?} {law:?}: {}", ringing.energy() / before);
        }
    }
}

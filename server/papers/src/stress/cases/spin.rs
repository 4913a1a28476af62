//! Cases 18, 19 and 20: free spin with implicit integrators, over four decades of step length.

use scindo_physics::body::{Arithmetic, Body, BodySettings, PcgSettings, Scheme};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::view;
use scindo_study::words::compact;

use super::support::{L, V, cube};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 18.
pub(super) const STEPS: Case = Case {
    number: Some(18),
    name: "step-sweep",
    title: "Steps from 0.1 ms to 0.2 s",
    set_up: "A free corotational cube of 48 tetrahedra, stretched by a fifth, spins at 10 and 40 rad/s; E = 1e4, \
             1e5, 1e6 and 1e7 Pa; steps of 1e-4, 1e-3, 5e-3, 0.02, 0.04, 0.1 and 0.2 s, up to 100 of them; implicit \
             Euler on the fast path and by Newton's method, and BDF2.",
    rule: "C. Implicit Euler: the energy is never above that of the start (1e-5 in single precision, 1e-9 in \
           double), whatever the rotation per step; the guard of the fast path divides steps that would gain \
           energy, slows parts that turn by more than 4 rad in a step, and reports both. BDF2: never more than 1 \
           % above; its guard takes over if the cube turns too far in a step, and reports this.",
    source: "no publication; bounds as measured",
    quick: false,
    run: step_sweep,
};

/// Case 19.
pub(super) const SPIN: Case = Case {
    number: Some(19),
    name: "free-spin",
    title: "A free spin of two seconds",
    set_up: "The same cube at rest shape spins freely at 10 and 40 rad/s, in steps of 5 and 20 ms.",
    rule: "C. Implicit Euler: angular momentum never grows; size grows by less than 1 %. BDF2 at 10 rad/s and \
           20 ms keeps 90 % of the angular momentum.",
    source: "no publication; bounds as measured",
    quick: true,
    run: free_spin,
};

/// Case 20.
pub(super) const NEWMARK: Case = Case {
    number: Some(20),
    name: "newmark-guard",
    title: "Newmark's method is guarded",
    set_up: "The same spins with Newmark's average acceleration, with two Newton steps and with twenty, steps of \
             5, 20 and 40 ms.",
    rule: "C. The energy is never more than 1 % above that of the start; every step that Euler makes instead is \
           reported.",
    source: "Schoch et al. 2013 (\"jiggling\")",
    quick: true,
    run: newmark,
};

fn material(young_pa: f64) -> Material {
    Material {
        young_pa,
        poisson: 0.3,
        density_kg_m3: 1000.0,
        rayleigh: Rayleigh::default(),
        law: Law::Corotational,
    }
}

fn newton(scheme: Scheme, steps: u32) -> BodySettings {
    BodySettings {
        solver: PcgSettings { iterations: 500, tolerance: 1e-6 },
        arithmetic: Some(Arithmetic::Double),
        newton_steps: Some(steps),
        scheme,
        ..BodySettings::default()
    }
}

/// A spinning body, on the fast path or with the given settings.
fn spinning(
    setting: &Setting,
    young: f64,
    omega: f64,
    stretch: f64,
    with: Option<BodySettings>,
) -> Result<Body, Trouble> {
    let mut body = match with {
        None => setting.body(cube(2), material(young), 500, 1e-6)?,
        Some(settings) => setting.with(cube(2), material(young), settings)?,
    };
    let centre = body.centre_of_mass();
    let x: Vec<V> = body.positions().iter().map(|x| V::new(stretch * x.x, x.y, x.z)).collect();
    let middle = V::new(stretch * centre.x, centre.y, centre.z);
    let v: Vec<V> = x.iter().map(|x| V::new(0.0, 0.0, omega).cross(&(x - middle))).collect();
    body.set_state(&x, &v)?;
    Ok(body)
}

/// Measurements of a spin, relative to its start.
struct Spin {
    most_energy: f64,
    momentum: f64,
    /// Largest growth of the angular momentum in one step.
    growth: f64,
    /// Largest length of the diagonal.
    size: f64,
    /// Steps that reported something.
    notices: usize,
    /// Angular momentum over time.
    path: Vec<[f64; 2]>,
}

fn spin(watch: &mut Watch, steps: usize) -> Spin {
    let (energy, momentum) = (watch.energy(), watch.body.angular_momentum().norm());
    let diagonal = |body: &Body| (body.positions()[26] - body.positions()[0]).norm();
    let length = diagonal(&watch.body);
    let mut spin = Spin {
        most_energy: 1.0,
        momentum: 1.0,
        growth: f64::NEG_INFINITY,
        size: 1.0,
        notices: 0,
        path: vec![[0.0, 1.0]],
    };
    for _ in 0..steps {
        let report = watch.step();
        spin.notices += usize::from(report.notice.is_some());
        let ratio = watch.energy() / energy;
        spin.most_energy = if ratio.is_nan() { ratio } else { spin.most_energy.max(ratio) };
        let now = watch.body.angular_momentum().norm() / momentum;
        spin.growth = spin.growth.max(now - spin.momentum);
        spin.momentum = now;
        spin.size = spin.size.max(diagonal(&watch.body) / length);
        spin.path.push([watch.time(), now]);
    }
    spin
}

fn step_sweep(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut most = Chart::new("largest energy over that of the start, less 1", "step [log₁₀ s]", "excess");
    type Choice = (&'static str, Option<BodySettings>, f64);
    let choices: [Choice; 3] = [
        ("Euler, fast path", None, 1e-5),
        ("Euler, Newton", Some(newton(Scheme::ImplicitEuler, 20)), 1e-9),
        ("BDF2", Some(newton(Scheme::Bdf2, 20)), 0.01),
    ];
    for (name, with, bound) in choices {
        let mut points = Vec::new();
        let (mut silent, mut fast_turns, mut told) = (0, 0, 0);
        for h in [1e-4, 1e-3, 5e-3, 2e-2, 4e-2, 0.1, 0.2] {
            let mut worst = f64::NEG_INFINITY;
            for young in [1e4, 1e5, 1e6, 1e7] {
                for omega in [10.0, 40.0] {
                    let body = spinning(setting, young, omega, 1.2, with)?;
                    let mut watch = Watch::new(format!("{name}, {} s", compact(h)), body, h, V::zeros());
                    let seconds: f64 = if h < 1e-3 { 0.02 } else { f64::min(2.0, 100.0 * h) };
                    let spin = spin(&mut watch, (seconds / h).round() as usize);
                    let excess = spin.most_energy - 1.0;
                    // NaN must win; a plain comparison would lose it.
                    worst = if excess.is_nan() || excess > worst { excess } else { worst };
                    // On the fast path this spin turns too far in its first step.
                    fast_turns += u32::from(with.is_none() && omega * h > 4.5);
                    told += u32::from(with.is_none() && spin.notices > 0);
                    // BDF2 starts with a step of implicit Euler, so it always has something to report.
                    silent += usize::from(name == "BDF2" && spin.notices == 0);
                    // Two runs of every integrator are drawn, while the common rule counts all.
                    if young == 1e5 && omega == 10.0 && (h == 2e-2 || h == 0.2) {
                        watch.finish(&mut common, &mut energies, &mut iterations);
                    } else {
                        common.merge(&watch.common());
                    }
                }
            }
            points.push([h.log10(), worst]);
            evidence.at_most(
                format!("energy above that of the start, {name}, {} s", compact(h)),
                worst,
                bound,
                "",
            );
        }
        // The guard may act more often, but not more rarely than the spin demands.
        if with.is_none() {
            evidence.at_least(
                "runs of the fast path with a notice of its guard",
                f64::from(told),
                f64::from(fast_turns),
                "",
            );
        }
        if name == "BDF2" {
            evidence.exactly("runs of BDF2 without a notice of its guard", silent, 0);
        }
        most.lines.push(Line { name: name.to_owned(), points });
    }
    evidence.charts.extend([most, energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn free_spin(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut momenta = Chart::new("angular momentum over that of the start", "time [s]", "L / L₀");
    for omega in [10.0, 40.0] {
        // Stiff enough that the centrifugal load itself stretches the body only a little: 1.2 % at 40 rad/s
        // for 1e5 Pa.
        let young = if omega > 20.0 { 1e6 } else { 1e5 };
        for h in [5e-3, 2e-2] {
            let paths =
                [("fast path", None, 1e-4), ("Newton", Some(newton(Scheme::ImplicitEuler, 20)), 1e-9)];
            for (path, with, bound) in paths {
                let name = format!("{path}, {omega} rad/s, {} ms", compact(1e3 * h));
                let mut watch =
                    Watch::new(name.clone(), spinning(setting, young, omega, 1.0, with)?, h, V::zeros());
                let spin = spin(&mut watch, (2.0 / h).round() as usize);
                evidence.at_most(
                    format!("largest growth of the angular momentum in a step, {name}"),
                    spin.growth,
                    bound,
                    "",
                );
                evidence.at_most(format!("growth of the size, {name}"), spin.size - 1.0, 0.01, "");
                evidence.at_most(
                    format!("energy above that of the start, {name}"),
                    spin.most_energy - 1.0,
                    if path == "Newton" { 1e-9 } else { 1e-5 },
                    "",
                );
                momenta.lines.push(Line { name, points: spin.path });
                watch.finish(&mut common, &mut energies, &mut iterations);
            }
        }
    }
    let bdf2 = spinning(setting, 1e5, 10.0, 1.0, Some(newton(Scheme::Bdf2, 20)))?;
    let mut watch = Watch::new("BDF2, 10 rad/s, 20 ms", bdf2, 0.02, V::zeros());
    let end = spin(&mut watch, 100);
    evidence.at_least("angular momentum kept by BDF2, 10 rad/s, 20 ms", end.momentum, 0.9, "");
    evidence.at_most("growth of the size, BDF2", end.size - 1.0, 0.01, "");
    momenta.lines.push(Line { name: "BDF2, 10 rad/s, 20 ms".into(), points: end.path });
    let body = watch.finish(&mut common, &mut energies, &mut iterations);
    evidence.pictures.push(view::surface(
        body.surface(),
        body.positions(),
        V::z(),
        "After two seconds of spin, BDF2",
    ));
    energies.lines.retain(|line| line.name.ends_with("kinetic"));
    evidence.charts.extend([momenta, energies, iterations]);
    common.tell(&mut evidence);
    evidence.tell("edge of the cube", L, "m");
    Ok(evidence)
}

fn newmark(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    for omega in [10.0, 40.0] {
        for h in [5e-3, 2e-2, 4e-2] {
            for steps in [2, 20] {
                let with = newton(Scheme::AVERAGE_ACCELERATION, steps);
                let name = format!("{omega} rad/s, {} ms, {steps} Newton", compact(1e3 * h));
                let mut watch =
                    Watch::new(name.clone(), spinning(setting, 1e5, omega, 1.0, Some(with))?, h, V::zeros());
                let count = (2.0 / h).round() as usize;
                let spin = spin(&mut watch, count);
                evidence.at_most(
                    format!("energy above that of the start, {name}"),
                    spin.most_energy - 1.0,
                    0.01,
                    "",
                );
                evidence.tell(format!("steps with a notice of the guard, {name}"), spin.notices as f64, "");
                if steps == 2 {
                    watch.finish(&mut common, &mut energies, &mut iterations);
                } else {
                    common.merge(&watch.common());
                }
            }
        }
    }
    energies.lines.retain(|line| line.name.ends_with("kinetic"));
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

//! The cases that come with the program: a cantilever with an analytic solution, a cut beam and a
//! drooping bar with stored ones, and the bar's motion.

use scindo_world::scene::Scene;

use super::gold::{Gold, Point, probes_override};
use super::{Case, Plan, Truth};
use crate::axes::{
    Axis, Factor, Setting, block, cells, iterations, on_bodies, precisions, step, steps, threads, tolerance,
    tolerances, words,
};
use crate::design::{Block, Configuration};
use crate::error::Goal;
use crate::series::Series;
use crate::trial::Protocol;

/// All laws.
pub(super) const LAWS: [&str; 4] = ["linear", "corotational", "stvk", "neo-hookean"];

/// Nienhuys' cantilever: small strain, against beam theory.
pub fn r1(quick: bool) -> Case {
    let body = ["beam".to_owned()];
    let (length, height, depth, young, force) = (1.2_f64, 0.2, 0.3, 1e6, 3.0);
    let points = [0.25_f64, 0.5, 0.75, 1.0].map(|s| s * length);
    let mut probes = Vec::new();
    let mut truth = Vec::new();
    for x in points {
        for (what, y) in [("axis", 0.5 * height), ("top", height)] {
            let id = format!("{what}-{}", (100.0 * x).round());
            probes.push(Point { id, point_m: [x, y, 0.5 * depth], side: None });
            truth.extend(timoshenko(x, y, [length, height, depth], young, force));
        }
    }
    let tip = -timoshenko(length, 0.5 * height, [length, height, depth], young, force)[1];
    let coarse = [[8, 2, 2], [16, 4, 4], [24, 6, 6]];
    let fine = [[32, 8, 8], [40, 10, 10], [48, 12, 12]];
    let (meshes, base) =
        if quick { (coarse.to_vec(), coarse[1]) } else { ([coarse, fine].concat(), fine[0]) };
    let mut axes = common(&body, "linear", cells("beam", &meshes, base), 1e-6);
    axes.insert(1, elements(&body));
    axes.insert(2, locking(&body));
    let meshes: Vec<String> = labels(&axes, Factor::Mesh);
    let small: Vec<String> = meshes.iter().take(4).cloned().collect();
    Case {
        name: "r1".into(),
        title: "R1 · Nienhuys’ cantilever".into(),
        about: "A block of 1.2 × 0.2 × 0.3 m, held at one end, carries 3 N at the other. Strains are small. \
                The meshes of Nienhuys’ Table 3.1, and finer and coarser ones."
            .into(),
        scene: load(include_str!("../../cases/r1.toml"), &[probes_override("beam", &probes)]),
        bodies: body.to_vec(),
        protocol: Protocol::Static,
        goal: Goal::new("deflection of the tip", 6, [0.0, -1.0, 0.0]),
        truth: Truth::Known {
            series: Series { frames: vec![0], displacement_m: truth, energy_j: vec![0.5 * force * tip] },
            goal: None,
            error_bar: 2e-3,
            law: "linear".into(),
            source: "Timoshenko’s beam (κ = 5/6): the tip sinks by 8.784 mm. Beam theory is itself a model; \
                     a block held at one whole face is within 0.2 % of it"
                .into(),
        },
        blocks: vec![
            Block(vec![
                (Factor::Element, names(&["tet4"])),
                (Factor::Mesh, meshes.clone()),
                (Factor::Tolerance, names(&["1e-2", "1e-4"])),
            ]),
            Block(vec![(Factor::Element, names(&["tet4", "hex8"])), (Factor::Mesh, meshes.clone())]),
            Block(vec![(Factor::Element, names(&["tet10"])), (Factor::Mesh, small)]),
            Block(vec![(Factor::Solver, names(&["cholesky"])), (Factor::Mesh, meshes)]),
        ],
        axes,
        colour: Factor::Element,
        shape: Factor::Solver,
    }
}

/// Displacement of a cantilever by Timoshenko's theory, κ = 5/6, ν = 0, so G = E/2: at (x, y), the
/// load F downwards at x = l.
fn timoshenko(x: f64, y: f64, [l, h, d]: [f64; 3], young: f64, force: f64) -> [f64; 3] {
    let bending = young * d * h.powi(3) / 12.0;
    let shear = 5.0 / 6.0 * 0.5 * young * h * d;
    let sinks = force / bending * (l * x * x / 2.0 - x.powi(3) / 6.0) + force * x / shear;
    let turns = force / bending * (l * x - x * x / 2.0);
    [(y - 0.5 * h) * turns, -sinks, 0.0]
}

/// Schoch's beam, half cut, under gravity.
pub fn r2_tc1(quick: bool) -> Case {
    let body = ["beam".to_owned()];
    let gold = Gold::read(include_str!("../../cases/r2-tc1.gold.json"));
    let coarse = [[2, 4, 14], [4, 8, 26], [6, 12, 40]];
    let fine = [[8, 16, 54], [10, 20, 66]];
    let (meshes, base) =
        if quick { (coarse[..2].to_vec(), coarse[1]) } else { ([&coarse[..], &fine].concat(), coarse[2]) };
    let axes = common(&body, "corotational", cells("beam", &meshes, base), 1e-6);
    let meshes = labels(&axes, Factor::Mesh);
    Case {
        name: "r2-tc1".into(),
        title: "R2-TC1 · Schoch’s cut beam".into(),
        about:
            "A beam of 30 × 60 × 200 mm (E = 300 kPa, ν = 0.35), held at its base and cut through to half \
                its depth. Gravity bends it sideways and opens the cut; the tip moves by half the length."
                .into(),
        scene: load(include_str!("../../cases/r2-tc1.toml"), &[gold.probes("beam")]),
        bodies: body.to_vec(),
        protocol: Protocol::Static,
        goal: Goal::new("sideways deflection of the tip", gold.probe("tip_mid"), [1.0, 0.0, 0.0]),
        truth: gold.truth("stvk", None, "Stored solution for St. Venant–Kirchhoff"),
        blocks: vec![
            Block(vec![(Factor::Law, names(&LAWS)), (Factor::Mesh, meshes.clone())]),
            Block(vec![(Factor::Tolerance, names(&["1e-2", "1e-4"])), (Factor::Mesh, meshes.clone())]),
            Block(vec![(Factor::Solver, names(&["cholesky"])), (Factor::Mesh, meshes)]),
        ],
        axes,
        colour: Factor::Law,
        shape: Factor::Solver,
    }
}

/// The bar that droops, at rest.
pub fn bar(quick: bool) -> Case {
    let body = ["bar".to_owned()];
    let gold = Gold::read(include_str!("../../cases/bar.gold.json"));
    let coarse = [[10, 2, 2], [20, 4, 4], [30, 6, 6]];
    let fine = [[40, 8, 8], [50, 10, 10]];
    let (meshes, base) =
        if quick { (coarse[..2].to_vec(), coarse[1]) } else { ([&coarse[..], &fine].concat(), coarse[2]) };
    let mut axes = common(&body, "corotational", cells("bar", &meshes, base), 1e-6);
    axes.insert(1, elements(&body));
    axes.insert(2, locking(&body));
    let meshes = labels(&axes, Factor::Mesh);
    let small: Vec<String> = meshes.iter().take(3).cloned().collect();
    Case {
        name: "bar".into(),
        title: "R3 · Bar, drooping".into(),
        about: "A bar of 1 × 0.2 × 0.2 m (E = 100 kPa, ν = 0.33, 100 kg/m³), held at one end, droops under \
                its own weight by a third of its length."
            .into(),
        scene: load(include_str!("../../cases/bar.toml"), &[gold.probes("bar")]),
        bodies: body.to_vec(),
        protocol: Protocol::Static,
        goal: Goal::new("droop of the tip", gold.probe("tip_center"), [0.0, -1.0, 0.0]),
        truth: gold.truth("stvk", Some(0.3450), "Stored solution for St. Venant–Kirchhoff"),
        blocks: vec![
            Block(vec![(Factor::Law, names(&LAWS)), (Factor::Mesh, meshes.clone())]),
            Block(vec![
                (Factor::Element, names(&["hex8"])),
                (Factor::Law, names(&LAWS)),
                (Factor::Mesh, meshes.clone()),
            ]),
            Block(vec![
                (Factor::Element, names(&["tet10"])),
                (Factor::Law, names(&LAWS)),
                (Factor::Mesh, small),
            ]),
            Block(vec![(Factor::Tolerance, names(&["1e-2"])), (Factor::Mesh, meshes)]),
        ],
        axes,
        colour: Factor::Element,
        shape: Factor::Law,
    }
}

/// The bar let go from straight: the motion over five seconds.
pub fn bar_motion(quick: bool) -> Case {
    let body = ["bar".to_owned()];
    let gold = Gold::read(include_str!("../../cases/bar.gold.json"));
    let coarse = [[10, 2, 2], [20, 4, 4]];
    let fine = [[30, 6, 6], [40, 8, 8]];
    let (meshes, base) =
        if quick { (coarse.to_vec(), coarse[0]) } else { ([coarse, fine].concat(), coarse[1]) };
    let frame_s = 0.04;
    let hs = if quick { vec![0.04, 0.02] } else { vec![0.08, 0.04, 0.02, 0.01, 0.005] };
    let integrators = ["implicit-euler", "bdf2", "newmark", "symplectic-euler", "midpoint", "rk4"];
    let mut axes = common(&body, "corotational", cells("bar", &meshes, base), 1e-4);
    let ten = axes.iter_mut().find(|axis| axis.factor == Factor::Tolerance);
    if let Some(axis) = ten {
        axis.settings.push(iterations(&body, 10));
    }
    axes.push(words(Factor::Integrator, &body, "integrator", &integrators, "implicit-euler"));
    axes.push(steps(&hs, frame_s));
    axes.sort_by_key(|axis| axis.factor);
    let (meshes, hs) = (labels(&axes, Factor::Mesh), labels(&axes, Factor::Step));
    let scene = load(
        include_str!("../../cases/bar.toml"),
        &[
            gold.probes("bar"),
            "body.bar.rayleigh={ mass_1_s = 0.0, stiffness_s = 0.02 }".into(),
            "body.bar.integrator=\"implicit-euler\"".into(),
        ],
    );
    Case {
        name: "bar-motion".into(),
        title: "R3 · Bar, in motion".into(),
        about: "The same bar, let go from straight: it falls, swings and comes to rest (stiffness damping \
                β = 20 ms). 125 frames of 40 ms are compared; the cost is that of one frame, however many \
                steps it takes."
            .into(),
        scene,
        bodies: body.to_vec(),
        protocol: Protocol::Motion { frame_s, frames: if quick { 25 } else { 125 } },
        goal: Goal::new("lowest point of the tip", gold.probe("tip_center"), [0.0, -1.0, 0.0]),
        truth: Truth::Extrapolated { law: "corotational".into(), plans: motion_plans(&body, &axes, quick) },
        blocks: vec![
            Block(vec![(Factor::Mesh, meshes.clone()), (Factor::Step, hs.clone())]),
            Block(vec![
                (Factor::Mesh, meshes),
                (Factor::Tolerance, names(&["10 iterations"])),
                (Factor::Step, hs.clone()),
            ]),
            Block(vec![(Factor::Integrator, names(&integrators)), (Factor::Step, hs)]),
        ],
        axes,
        colour: Factor::Integrator,
        shape: Factor::Law,
    }
}

/// The limit of the motion: second-order integrators first, should they be there.
fn motion_plans(bodies: &[String], axes: &[Axis], quick: bool) -> Vec<Plan> {
    let meshes =
        if quick { [[10, 2, 2], [16, 3, 3], [20, 4, 4]] } else { [[20, 4, 4], [30, 6, 6], [40, 8, 8]] };
    let steps_s = if quick { [0.02, 0.01, 0.005] } else { [0.01, 0.005, 0.0025] };
    let base = Configuration::base(axes).with(Factor::Tolerance, &tolerance(bodies, 1e-8));
    let integrators = axes.iter().find(|axis| axis.factor == Factor::Integrator);
    let plan = |name: &str| {
        let integrator = integrators?.find(name)?;
        Some(Plan {
            configuration: base.with(Factor::Integrator, integrator),
            meshes: Some(meshes.map(|cells| block("bar", cells))),
            steps: Some(steps_s.map(step)),
            words: format!("{name}, tet4"),
        })
    };
    ["bdf2", "implicit-euler"].iter().filter_map(|name| plan(name)).collect()
}

/// Law, mesh, solver, tolerance, precision, threads.
pub(super) fn common(bodies: &[String], law: &str, mesh: Axis, tolerance: f64) -> Vec<Axis> {
    vec![
        words(Factor::Law, bodies, "law", &LAWS, law),
        mesh,
        words(Factor::Solver, bodies, "solver.method", &["pcg", "cg", "cholesky"], "pcg"),
        tolerances(bodies, &[1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10], tolerance),
        precisions(bodies),
        threads(&[1, 2]),
    ]
}

/// Elements; hexahedra need cells that are not split.
pub(super) fn elements(bodies: &[String]) -> Axis {
    words(Factor::Element, bodies, "element", &["tet4", "tet10", "hex8"], "tet4")
}

/// Remedies against locking.
pub(super) fn locking(bodies: &[String]) -> Axis {
    let on = Setting::new("remedied", 1.0, on_bodies(bodies, "volumetric", "\"remedied\""));
    Axis::new(Factor::Locking, vec![Setting::new("none", 0.0, Vec::new()), on], "none")
}

fn labels(axes: &[Axis], factor: Factor) -> Vec<String> {
    let axis = axes.iter().find(|axis| axis.factor == factor);
    axis.map(|axis| axis.settings.iter().map(|s| s.label.clone()).collect()).unwrap_or_default()
}

fn names(labels: &[&str]) -> Vec<String> {
    labels.iter().map(|label| (*label).to_owned()).collect()
}

fn load(text: &str, overrides: &[String]) -> Scene {
    let scene = Scene::from_toml(text).and_then(|scene| scene.apply_sets(overrides));
    scene.expect("the file is part of the program and a test reads it")
}

//! The drooping bar: at rest against stored solutions, in motion against its own limit.

use scindo_study::case::LAWS;
use scindo_study::case::{Case, Plan, Truth};
use scindo_study::design::axes::{
    Axis, Factor, block, cells, elements, iterations, step, steps, tolerance, words,
};
use scindo_study::design::{Block, Configuration};
use scindo_study::trial::Protocol;
use scindo_study::trial::distance::Goal;

use super::gold::Gold;
use super::shared::{axes, labels, load, names};

const SCENE: &str = include_str!("../../cases/bar.toml");

fn gold() -> Gold {
    Gold::read(include_str!("../../cases/bar.gold.json"))
}

/// The bar at rest, against stored solutions.
pub(super) fn at_rest(quick: bool) -> Case {
    let body = ["bar".to_owned()];
    let gold = gold();
    let all = [[10, 2, 2], [20, 4, 4], [30, 6, 6], [40, 8, 8]];
    let (meshes, base) = if quick { (&all[..2], all[0]) } else { (&all[..], all[1]) };
    let mesh = cells("bar", meshes, base);
    let axes = axes(&body, "corotational", elements(&body, Some("tet5"), "tet4"), mesh, 1e-4);
    let meshes = labels(&axes, Factor::Mesh);
    let small: Vec<String> = meshes.iter().take(if quick { 1 } else { 2 }).cloned().collect();
    Case {
        name: "bar-rest".into(),
        title: "R3 · Bar, drooping".into(),
        about: "A bar of 1 × 0.2 × 0.2 m (E = 100 kPa, ν = 0.33, 100 kg/m³), held at one end, droops under \
                its own weight by a third of its length."
            .into(),
        scene: load(SCENE, &[gold.probes("bar")]),
        bodies: body.to_vec(),
        protocol: Protocol::Static,
        fewest_frames: 0,
        notes: Vec::new(),
        goal: Goal::new("droop of the tip", gold.probe("tip_center"), [0.0, -1.0, 0.0]),
        truth: gold.truth("stvk", Some(0.3450), "Stored solution for St. Venant–Kirchhoff"),
        blocks: vec![
            Block(vec![
                (Factor::Element, names(&["tet4", "hex8"])),
                (Factor::Law, names(&LAWS)),
                (Factor::Mesh, meshes.clone()),
            ]),
            Block(vec![
                (Factor::Element, names(&["tet10"])),
                (Factor::Law, names(&LAWS)),
                (Factor::Mesh, small),
            ]),
            Block(vec![
                (Factor::Element, names(&["tet4 node-averaged", "hex8 selective"])),
                (Factor::Mesh, meshes.clone()),
            ]),
            Block(vec![(Factor::Tolerance, names(&["1e-2"])), (Factor::Mesh, meshes)]),
        ],
        axes,
        colour: Factor::Element,
        shape: Factor::Law,
    }
}

/// The bar released from its straight shape: five seconds of motion.
pub(super) fn in_motion(quick: bool) -> Case {
    let body = ["bar".to_owned()];
    let gold = gold();
    let all = [[10, 2, 2], [20, 4, 4], [30, 6, 6], [40, 8, 8]];
    let (meshes, base) = if quick { (&all[..2], all[0]) } else { (&all[..], all[1]) };
    let frame_s = 0.04;
    let hs = if quick { vec![0.04, 0.02] } else { vec![0.08, 0.04, 0.02, 0.01] };
    // Explicit integrators divide the step further until it is stable.
    let explicit = if quick { 0.02 } else { 0.01 };
    let integrators = ["implicit-euler", "bdf2", "newmark", "symplectic-euler", "midpoint", "rk4"];
    let mesh = cells("bar", meshes, base);
    let mut axes = axes(&body, "corotational", elements(&body, Some("tet5"), "tet4"), mesh, 1e-4);
    // Beside tolerances a fixed number of iterations, as a simulation in real time has it.
    if let Some(axis) = axes.iter_mut().find(|axis| axis.factor == Factor::Tolerance) {
        axis.settings.push(iterations(&body, 10));
    }
    axes.push(words(Factor::Integrator, &body, "integrator", &integrators, "implicit-euler"));
    axes.push(steps(&hs, frame_s));
    axes.sort_by_key(|axis| axis.factor);
    let (meshes, hs) = (labels(&axes, Factor::Mesh), labels(&axes, Factor::Step));
    let moving = [
        gold.probes("bar"),
        "body.bar.rayleigh={ mass_1_s = 1.0, stiffness_s = 0.002 }".to_owned(),
        "body.bar.integrator=\"implicit-euler\"".to_owned(),
    ];
    Case {
        name: "bar-motion".into(),
        title: "R3 · Bar, in motion".into(),
        about: format!(
            "The same bar, released from its straight shape: it falls, swings and comes to rest (Rayleigh \
             damping α = 1/s, β = 2 ms). {} frames of 40 ms are compared. The cost is that of one frame, \
             whatever its number of steps.",
            frames(quick)
        ),
        scene: load(SCENE, &moving),
        bodies: body.to_vec(),
        protocol: Protocol::Motion { frame_s, frames: frames(quick) },
        fewest_frames: 0,
        notes: Vec::new(),
        goal: Goal::new("lowest point of the tip", gold.probe("tip_center"), [0.0, -1.0, 0.0]),
        // No solution of the motion is stored; its limit is extrapolated from the bar's own runs.
        truth: Truth::Extrapolated { law: "corotational".into(), plans: plans(&body, &axes, quick) },
        blocks: vec![
            Block(vec![(Factor::Mesh, meshes.clone()), (Factor::Step, hs.clone())]),
            Block(vec![
                (Factor::Tolerance, names(&["10 iterations"])),
                (Factor::Mesh, meshes.clone()),
                (Factor::Step, hs.iter().take(3).cloned().collect()),
            ]),
            Block(vec![
                (Factor::Integrator, names(&["bdf2", "newmark"])),
                (Factor::Element, names(&["tet4", "hex8"])),
                (Factor::Step, hs.clone()),
            ]),
            // Explicit steps are short and many, so these integrators run on the coarsest mesh only.
            Block(vec![
                (Factor::Integrator, names(&integrators[3..])),
                (Factor::Mesh, meshes.iter().take(1).cloned().collect()),
                (Factor::Step, vec![step(explicit).label]),
            ]),
        ],
        axes,
        colour: Factor::Integrator,
        shape: Factor::Element,
    }
}

fn frames(quick: bool) -> u32 {
    if quick { 15 } else { 125 }
}

/// Plans for the limit of the motion, best element and integrator first.
fn plans(bodies: &[String], axes: &[Axis], quick: bool) -> Vec<Plan> {
    let base = Configuration::base(axes).with(Factor::Tolerance, &tolerance(bodies, 1e-6));
    let tens = [[10, 2, 2], [15, 3, 3], [20, 4, 4]];
    let ways = [
        ("hex8 selective", "bdf2", if quick { tens } else { [[10, 2, 2], [20, 4, 4], [30, 6, 6]] }),
        ("tet4", "implicit-euler", if quick { tens } else { [[20, 4, 4], [30, 6, 6], [40, 8, 8]] }),
    ];
    let find = |factor: Factor, label: &str| axes.iter().find(|axis| axis.factor == factor)?.find(label);
    let plan = |(element, integrator, meshes): (&str, &str, [[usize; 3]; 3])| {
        let configuration = base.with(Factor::Element, find(Factor::Element, element)?);
        Some(Plan {
            configuration: configuration.with(Factor::Integrator, find(Factor::Integrator, integrator)?),
            meshes: Some(meshes.map(|cells| block("bar", cells))),
            steps: Some([0.02, 0.01, 0.005].map(step)),
            words: format!("{integrator}, {element}"),
        })
    };
    ways.into_iter().filter_map(plan).collect()
}

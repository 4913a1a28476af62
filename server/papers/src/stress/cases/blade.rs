//! Blades that cut with force.

use super::super::case::{Case, Setting};
use super::super::evidence::Evidence;
use super::touch::{Run, WORLD, block};
use crate::lab::Trouble;

/// A blade that is pressed, torn and shaken.
pub(super) const PRESSED: Case = Case {
    number: None,
    name: "cutting-with-force",
    title: "A blade is pressed into a tough block, torn through it, and shaken in it",
    set_up: "A block of E = 20 kPa and a toughness of 60 J/m², on its base. A blade is pressed through it by a spring \
             of 800 N/m and by one of 10⁵ N/m, in 1 s; torn through it in 20 ms; and shaken in it by ±1 cm along and \
             across at 5 Hz. Steps of 10 ms, with tetrahedra and, pressed by 800 N/m, octree cells.",
    rule: "Every step advances, all numbers stay finite, and the block comes to rest: its kinetic energy ends below \
           1e-6 J. Where it is pressed through, the work of the edge is that of the toughness times the area that \
           opened, to 5 % (12 % between cells, whose lips are larger than what the blade swept).",
    source: "Jeřábková 2007, 4.1.3: cutting with force feedback",
    quick: true,
    run: pressed,
};

const TOUGHNESS_J_M2: f64 = 60.0;

fn pressed(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let through = |seconds: f64| vec![(0.0, 0.051, -0.03, 0.042), (seconds, 0.051, -0.03, -0.012)];
    let shake = |x: f64, y: f64, z: f64| {
        let swing = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut path = vec![(0.0, 0.051, -0.03, 0.042), (0.5, 0.051, -0.03, 0.02)];
        path.extend((0..10).map(|i| {
            let by = 0.01 * swing(i);
            (0.6 + 0.1 * i as f64, 0.051 + x * by, -0.03 + y * by, 0.02 + z * by)
        }));
        path
    };
    let trials = [
        ("pressed by 800 N/m", 800.0, through(1.0), "", Some(0.05)),
        ("pressed by 1e5 N/m", 1e5, through(1.0), "", Some(0.05)),
        ("torn in 20 ms", 800.0, through(0.02), "", None),
        ("shaken along", 800.0, shake(0.0, 1.0, 0.5), "", None),
        ("shaken across", 800.0, shake(1.0, 0.0, 0.5), "", None),
        ("octree, pressed by 800 N/m", 800.0, through(1.0), "element = \"octree\"", Some(0.12)),
    ];
    for (name, stiffness, path, element, bound) in trials {
        let mut run = Run::new(&scene(stiffness, &path, element), setting)?;
        run.steps(300);
        let body = &run.sim.bodies()[0].body;
        if let Some(bound) = bound {
            let least = TOUGHNESS_J_M2 * body.opened_area(1);
            let work = run.sim.edge_report(0).map_or(0.0, |edge| edge.work_j);
            evidence.at_most(
                format!("work of the edge, off J A, {name}"),
                (work / least - 1.0).abs(),
                bound,
                "",
            );
            evidence.at_least(format!("parts, {name}"), body.components().len() as f64, 2.0, "");
        }
        evidence.at_most(format!("kinetic energy at the end, {name}"), run.kinetic_energy(), 1e-6, "J");
        run.tell(name, 1.0, &mut evidence);
    }
    Ok(evidence)
}

fn scene(stiffness: f64, path: &[(f64, f64, f64, f64)], element: &str) -> String {
    let cells = if element.is_empty() { [12, 8, 6] } else { [20, 12, 8] };
    let lines = format!(
        "cutting = {{ toughness_j_m2 = {TOUGHNESS_J_M2:?} }}\n{element}\n\
         [[body.fix]]\nwhere = {{ slab = {{ axis = \"z\", from = 0, to = 0.001 }} }}"
    );
    let path: Vec<String> = path
        .iter()
        .map(|(at, x, y, z)| {
            format!("{{ at_s = {at:?}, tip_m = [{x:?}, {y:?}, {z:?}], toward = [0, 1, 0], mode = \"cut\" }}")
        })
        .collect();
    let blade = format!(
        "[[tool]]\nid = \"blade\"\nshape = {{ blade = {{ length_m = 0.12, thickness_m = 0.001 }} }}\n\
         stiffness_n_m = {stiffness:?}\nmax_force_n = 40\npath = [{}]\n",
        path.join(", ")
    );
    [WORLD, &block("flesh", [0.0; 3], [0.1, 0.06, 0.04], cells, &lines), &blade].concat()
}

//! Cases 14 to 17: bodies that start inverted, collapsed, flat, stretched or scrambled.

use nalgebra::Matrix3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, PcgSettings};
use scindo_physics::material::{Law, Material, Rayleigh, StVenantKirchhoff};
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::view;

use super::support::{L, V, cube};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 14.
pub(super) const INVERTED: Case = Case {
    number: Some(14),
    name: "inverted",
    title: "Every element starts inverted",
    set_up: "A cube of 48 tetrahedra is turned inside out: x → −x for all coordinates, then for one. Five \
             seconds in steps of 20 ms without gravity, slight drag.",
    rule: "C. Corotational (fast path and Newton's method) and stable Neo-Hookean recover their shape to 1e-4 of \
           the edge within 5 s, and no element stays inverted; modified St. Venant–Kirchhoff recovers it to \
           1e-2. The law as published has no stress in a mirror image: all 48 elements stay inverted.",
    source: "Irving 2004; Smith 2018",
    quick: true,
    run: |setting| {
        let ruins: [(&str, Ruin); 2] = [("x → −x", |_, X| -X), ("mirrored", |_, X| V::new(-X.x, X.y, X.z))];
        let mut evidence = recover(setting, &ruins, [1e-4, 1e-4, 1e-4, 1e-2])?;
        let lame = material(Law::StVenantKirchhoff).lame();
        let mirror = Matrix3::from_diagonal(&V::new(-1.0, 1.0, 1.0));
        let stress = StVenantKirchhoff::plain(lame).stress(&mirror).norm() / lame.mu;
        evidence.at_most(
            "stress of a mirror image by the published St. Venant–Kirchhoff law, over μ",
            stress,
            1e-12,
            "",
        );
        Ok(evidence)
    },
};

/// Case 15.
pub(super) const COLLAPSED: Case = Case {
    number: Some(15),
    name: "collapsed",
    title: "All nodes in one point",
    set_up: "The same cube with all nodes at the origin: exactly, with noise of 1e-12 and of 1e-9 edges, and \
             shrunk to a thousandth. One noise of each size is shown; with others the corotational body may \
             end folded (no inverted element, shape off by 1.4 edges), so this is no proof for every noise.",
    rule: "C. The same bounds as for the inverted cube.",
    source: "Smith 2018",
    quick: false,
    run: |setting| {
        let ruins: [(&str, Ruin); 4] = [
            ("a point", |_, _| V::zeros()),
            ("noise 1e-12", |i, _| 1e-12 * L * noise(i)),
            ("noise 1e-9", |i, _| 1e-9 * L * noise(i)),
            ("a thousandth", |_, X| 1e-3 * X),
        ];
        recover(setting, &ruins, [1e-4, 1e-4, 1e-4, 1e-2])
    },
};

/// Case 16.
pub(super) const FLATTENED: Case = Case {
    number: Some(16),
    name: "flattened",
    title: "Flattened to a plane, stretched twenty times",
    set_up: "The same cube with z := 0, then with x := 20 x.",
    rule: "C. The same bounds as for the inverted cube.",
    source: "Chen 2024 (vertex block descent)",
    quick: true,
    run: |setting| {
        let ruins: [(&str, Ruin); 2] =
            [("flat", |_, X| V::new(X.x, X.y, 0.0)), ("stretched", |_, X| V::new(20.0 * X.x, X.y, X.z))];
        recover(setting, &ruins, [1e-4, 1e-4, 1e-4, 1e-2])
    },
};

/// Case 17.
pub(super) const SCRAMBLED: Case = Case {
    number: Some(17),
    name: "scrambled",
    title: "Every node at a random place",
    set_up: "The same cube with every node at a random place in its box, then cubes of 6 × 6 × 6 cells for 15 steps.",
    rule: "C. The small cube: the same bounds as for the inverted one. The large one: finite, and the energy \
           never grows by more than 1e-9 of that at the start in a step with Newton's method, by more than 1 % \
           on the fast path, which makes one linear solve per step without a line search.",
    source: "Chen 2024",
    quick: false,
    run: scrambled,
};

/// Maps index and rest position of a node to its start position. The cube is centred at the origin.
type Ruin = fn(usize, &V) -> V;

const H: f64 = 0.02;
const STEPS: usize = 250;

fn material(law: Law) -> Material {
    // Drag removes the spin that a body acquires while it recovers. A spin of ω alone strains the body by
    // ρω²L²/E, up to 1e-4.
    let rayleigh = Rayleigh { mass_1_s: 0.5, stiffness_s: 0.0 };
    Material { young_pa: 1e5, poisson: 0.3, density_kg_m3: 1e3, rayleigh, law }
}

/// A deterministic vector with components in [-1, 1).
fn noise(i: usize) -> V {
    V::from_fn(|axis, _| {
        let h = (3 * i as u64 + axis as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    })
}

/// The corotational law on the fast path and with Newton's method; the other laws with Newton's method.
fn bodies(setting: &Setting, cells: usize) -> Result<[(&'static str, Body); 4], Trouble> {
    let mut mesh = cube(cells);
    mesh.nodes.iter_mut().for_each(|X| *X -= V::repeat(0.5 * L));
    let newton = BodySettings {
        solver: PcgSettings { iterations: 500, tolerance: 1e-6 },
        arithmetic: Some(Arithmetic::Double),
        newton_steps: Some(20),
        ..BodySettings::default()
    };
    let general = |law: Law| setting.with(mesh.clone(), material(law), newton);
    Ok([
        ("corotational, fast", setting.body(mesh.clone(), material(Law::Corotational), 500, 1e-6)?),
        ("corotational", general(Law::Corotational)?),
        ("Neo-Hookean", general(Law::NeoHookean)?),
        ("St. Venant–Kirchhoff", general(Law::StVenantKirchhoff)?),
    ])
}

/// Largest error of a distance between two nodes, relative to the edge.
fn shape_error(body: &Body) -> f64 {
    let (x, X) = (body.positions(), body.rest_positions());
    let pairs = (0..x.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    pairs.map(|(i, j)| ((x[i] - x[j]).norm() - (X[i] - X[j]).norm()).abs() / L).fold(0.0, f64::max)
}

fn recover(setting: &Setting, ruins: &[(&str, Ruin)], bounds: [f64; 4]) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut shapes = Chart::new("largest error of a distance between two nodes", "time [s]", "error / edge");
    shapes.logarithmic = true;
    for (name, ruin) in ruins {
        for ((law, mut body), bound) in bodies(setting, 2)?.into_iter().zip(bounds) {
            let x: Vec<V> = body.rest_positions().iter().enumerate().map(|(i, X)| ruin(i, X)).collect();
            body.set_state(&x, &vec![V::zeros(); x.len()])?;
            let mut watch = Watch::new(format!("{law}, {name}"), body, H, V::zeros());
            let mut points = vec![[0.0, shape_error(&watch.body)]];
            for k in 0..STEPS {
                watch.step();
                points.push([watch.time(), shape_error(&watch.body).max(1e-9)]);
                if k == 1 && law == "Neo-Hookean" {
                    evidence
                        .pictures
                        .push(view::body(&watch.body, format!("{name}, {law}: after two steps")));
                }
            }
            evidence.at_most(
                format!("error of the shape, {law}, {name}"),
                shape_error(&watch.body),
                bound,
                "edges",
            );
            let left = watch.body.least_volume_ratio();
            evidence.at_least(format!("least det F, {law}, {name}"), left, 0.9, "");
            shapes.lines.push(Line { name: format!("{law}, {name}"), points });
            watch.finish(&mut common, &mut energies, &mut iterations);
        }
    }
    energies.lines.retain(|line| line.name.ends_with("elastic") && !line.name.contains("fast"));
    energies.logarithmic = true;
    evidence.charts.extend([shapes, energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn scrambled(setting: &Setting) -> Result<Evidence, Trouble> {
    let ruins: [(&str, Ruin); 1] = [("scrambled", |i, _| 0.5 * L * noise(i))];
    let mut evidence = recover(setting, &ruins, [1e-4, 1e-4, 1e-4, 1e-2])?;
    for (law, mut body) in bodies(setting, 6)? {
        let x: Vec<V> = (0..body.rest_positions().len()).map(|i| 0.5 * L * noise(i)).collect();
        body.set_state(&x, &vec![V::zeros(); x.len()])?;
        let mut watch = Watch::new("", body, H, V::zeros());
        let (start, mut gain, mut last) = (watch.energy(), f64::NEG_INFINITY, watch.energy());
        for _ in 0..15 {
            watch.step();
            gain = gain.max((watch.energy() - last) / start);
            last = watch.energy();
        }
        let common = watch.common();
        evidence.exactly(format!("numbers not finite, {law}, 1296 elements"), common.not_finite, 0);
        evidence.at_most(
            format!("largest gain of energy in a step over that at the start, {law}, 1296 elements"),
            gain,
            if law.ends_with("fast") { 0.01 } else { 1e-9 },
            "",
        );
        if law == "corotational" {
            evidence.pictures.push(view::body(&watch.body, "1296 elements, scrambled, after 0.3 s"));
        }
    }
    Ok(evidence)
}

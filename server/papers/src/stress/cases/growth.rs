//! Cases 10 and 11: a cut that grows tick by tick, and a cut that is repeated.

use scindo_physics::body::Body;
use scindo_physics::cut::{BladeSweep, CutMesh, Flaws};
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::view;

use super::flaws::tell;
use super::support::{L, SOFT, V, block, cube, nodes, plane};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 10.
pub(super) const GROWTH: Case = Case {
    number: Some(10),
    name: "growing-cut",
    title: "A cut that grows by a tenth of an element per tick",
    set_up: "A block of 10 × 3 × 4 cells, its lower face clamped, gravity pulling its upper half sideways \
             and up. A blade advances by a tenth of a cell per step of 10 ms, from one end to the other.",
    rule: "C. One part until the blade has passed; the wound only grows and is never more than one element \
           behind the blade. Cutting changes mass, momentum, angular momentum and both energies by at most 1e-12 \
           at every tick.",
    source: "Jeřábková 2007, §4.1.3",
    quick: true,
    run: growing,
};

/// Case 11.
pub(super) const AGAIN: Case = Case {
    number: Some(11),
    name: "same-cut-again",
    title: "The same cut fifty times",
    set_up: "A cube of 162 tetrahedra is cut by an oblique plane, then 50 times more by the same sweep under the \
             same and six other incision numbers.",
    rule: "No copy, piece, fragment or surface triangle is added after the first sweep.",
    source: "own",
    quick: true,
    run: again,
};

/// Edge of a cell [m].
const CELL: f64 = 0.01;

/// Rest area of the lips [m²] and their reach along x [m].
pub(super) fn wound(body: &Body) -> (f64, f64) {
    let surface = body.surface();
    let place = |v: u32| surface.vertices[v as usize].position(body.rest_positions());
    let (mut area, mut reach) = (0.0, 0.0_f64);
    for (t, _) in surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag > 0) {
        let [a, b, c] = t.map(place);
        area += 0.5 * (b - a).cross(&(c - a)).norm();
        reach = reach.max(a.x).max(b.x).max(c.x);
    }
    (area, reach)
}

/// Mass, momentum, angular momentum and both energies.
pub(super) type Measures = (f64, V, V, [f64; 2]);

/// Those of a body.
pub(super) fn measure(body: &Body) -> Measures {
    let energies = [body.kinetic_energy(), body.elastic_energy()];
    (body.total_mass(), body.momentum(), body.angular_momentum(), energies)
}

/// The largest relative change from `before` to `after` in a body of this `length` [m].
pub(super) fn largest_change(before: &Measures, after: &Measures, length: f64) -> f64 {
    let flow = before.1.norm().max(1e-9);
    let changes = [
        (after.0 / before.0 - 1.0).abs(),
        (after.1 - before.1).norm() / flow,
        (after.2 - before.2).norm() / (flow * length),
        (after.3[0] - before.3[0]).abs() / before.3[0].max(1e-9),
        (after.3[1] - before.3[1]).abs() / before.3[1].max(1e-9),
    ];
    changes.into_iter().fold(0.0, f64::max)
}

fn growing(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut body = setting.body(block([10.0 * CELL, 3.0 * CELL, 4.0 * CELL], [10, 3, 4]), SOFT, 300, 1e-6)?;
    let clamp = nodes(body.rest_positions(), |X| X.z == 0.0);
    body.fix(&clamp, [true; 3], V::zeros())?;
    let mut watch = Watch::new("", body, 0.01, V::new(-2.0, 0.0, 9.0));
    let height = 2.03 * CELL;
    let blade = |x: f64| [V::new(x, -10.0 * CELL, height), V::new(x, 13.0 * CELL, height)];
    let (mut early, mut shrunk, mut lag, mut change) = (0, 0, 0.0_f64, 0.0_f64);
    let (mut area, mut growth) = (0.0, Vec::new());
    for tick in 0..=120 {
        let x = (f64::from(tick) - 8.0) * 0.1 * CELL;
        let before = measure(&watch.body);
        watch.cut(&BladeSweep { segments: vec![blade(x)] }, 1)?;
        let after = measure(&watch.body);
        change = largest_change(&before, &after, 10.0 * CELL).max(change);
        let (now, reach) = wound(&watch.body);
        shrunk += usize::from(now < area * (1.0 - 1e-12));
        area = now;
        growth.push([watch.time(), 1e4 * area]);
        if x < 10.0 * CELL {
            early += usize::from(watch.body.parts().len() > 1);
            if x > 0.0 {
                lag = lag.max((x - reach) / CELL);
            }
        }
        watch.step();
        if tick == 70 {
            evidence.pictures.push(view::surface(
                watch.body.surface(),
                watch.body.positions(),
                V::z(),
                "The blade has come two thirds of the way",
            ));
        }
    }
    evidence.exactly("ticks with more than one part before the blade is through", early, 0);
    evidence.exactly("parts at the end", watch.body.parts().len(), 2);
    evidence.exactly("ticks at which the wound got smaller", shrunk, 0);
    evidence.at_most("largest distance of the wound behind the blade", lag, 1.0, "cells");
    evidence.at_most("largest change of mass, momenta and energies by a tick", change, 1e-12, "");
    evidence.tell("area of the lips at the end", 1e4 * area, "cm²");
    tell(&watch.body.flaws(), &mut evidence);
    watch.finish(&mut common, &mut energies, &mut iterations);
    let mut chart = Chart::new("the wound grows", "time [s]", "area of both lips [cm²]");
    chart.lines.push(Line { name: "area".into(), points: growth });
    evidence.charts.extend([energies, iterations, chart]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn again(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut body = super::support::Shaped::new(setting.cut_mesh(cube(3))?);
    let blade = plane(V::new(0.5, 0.5, 0.45) * L, V::new(0.1, 0.2, 1.0), 2.0 * L);
    body.sweep(&blade, 1)?;
    let count = |mesh: &CutMesh| {
        [mesh.components().len(), mesh.pieces().len(), mesh.n_copies(), mesh.surface().triangles.len()]
    };
    let first = count(&body.mesh);
    let mut added = [0; 4];
    for k in 0..50 {
        body.sweep(&blade, 1 + k % 7)?;
        let now = count(&body.mesh);
        (0..4).for_each(|i| added[i] = added[i].max(now[i].abs_diff(first[i])));
    }
    evidence.exactly("parts after the first sweep", first[0], 2);
    for (what, added) in ["parts", "pieces", "copies", "surface triangles"].into_iter().zip(added) {
        evidence.exactly(format!("{what} added by fifty more"), added, 0);
    }
    evidence.exactly("shells of the surface", body.mesh.surface().n_shells(), 2);
    tell(&Flaws::of(&body.mesh), &mut evidence);
    evidence.pictures.push(view::surface(body.mesh.surface(), &body.x, V::y(), "After 51 sweeps"));
    Ok(evidence)
}

//! Case 32: a kilometre away from the origin.

use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::view;

use super::support::{DOWN, SOFT, V};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 32.
pub(super) const CASE: Case = Case {
    number: Some(32),
    name: "far-field",
    title: "A kilometre from the origin",
    set_up: "A clamped bar of 0.3 m swings under gravity for a second, at the origin and at (1000, −500, 300) m. \
             Kernels and solver work in single precision.",
    rule: "C. The two motions differ by at most 1e-4 of the length.",
    source: "own",
    quick: true,
    run,
};

const LENGTH: f64 = 0.3;

fn run(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut paths: Vec<Vec<Vec<V>>> = Vec::new();
    for (name, origin) in [("near", V::zeros()), ("far", V::new(1000.0, -500.0, 300.0))] {
        let pattern = BoxPattern::Tet5 { parity: true };
        let mesh = box_mesh(origin, origin + V::new(LENGTH, 0.1, 0.1), [6, 2, 2], pattern);
        let mut body = setting.body(mesh, SOFT, 200, 1e-7)?;
        let clamp: Vec<u32> = (0..body.rest_positions().len() as u32).step_by(7).collect();
        body.fix(&clamp, [true; 3], V::zeros())?;
        let mut watch = Watch::new(name, body, 0.02, DOWN);
        let mut path = Vec::new();
        for _ in 0..50 {
            watch.step();
            path.push(watch.body.positions().iter().map(|x| x - origin).collect());
        }
        paths.push(path);
        let body = watch.finish(&mut common, &mut energies, &mut iterations);
        if origin != V::zeros() {
            evidence.pictures.push(view::body(&body, "The bar far away, after one second"));
        }
    }
    let apart = |(near, far): (&Vec<V>, &Vec<V>)| {
        near.iter().zip(far).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) / LENGTH
    };
    let apart: Vec<f64> = paths[0].iter().zip(&paths[1]).map(apart).collect();
    let droop = paths[0].last().and_then(|x| x.last()).map_or(0.0, |x| (0.1 - x.y) / LENGTH);
    evidence.at_least("the tip has moved, in lengths", droop, 5e-3, "");
    evidence.at_most(
        "largest distance of the two motions, in lengths",
        apart.iter().fold(0.0, |a, b| a.max(*b)),
        1e-4,
        "",
    );
    let points = apart.iter().enumerate().map(|(k, d)| [0.02 * (k + 1) as f64, *d]).collect();
    let mut chart = Chart::new("distance of the two motions", "time [s]", "distance / length");
    chart.logarithmic = true;
    chart.lines.push(Line { name: "largest distance of a node".into(), points });
    evidence.charts.extend([energies, iterations, chart]);
    common.tell(&mut evidence);
    Ok(evidence)
}

//! Cost of cutting: one sweep through about a thousand elements of a 20 000-tet body, a cut that grows
//! in small advances, and the build of the uncut state. `--quick` runs each once on a small body.

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

fn main() {
    let quick = std::env::args().any(|a| a == "--quick");
    let (cells, repeats) = if quick { (5, 1) } else { (15, 9) };
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [cells; 3], BoxPattern::Tet6);
    let uncut = CutMesh::new(mesh.clone()).expect("a box mesh can be cut");
    println!("{} tets, {} nodes", mesh.tets.len(), mesh.nodes.len());

    let build = median(repeats, || {
        let mesh = mesh.clone();
        timed(|| CutMesh::new(mesh)).1
    });
    println!("uncut state            {:8.3} ms", build * 1e3);

    let blade = |x: f64| [Vector3::new(x, -0.01, 0.052), Vector3::new(x, 0.11, 0.052 + 0.01 * x)];
    let mut elements = 0;
    let whole = median(repeats, || {
        let mut body = uncut.clone();
        let x = body.rest_positions();
        let sweep = BladeSweep { segments: vec![blade(-0.01), blade(0.11)] };
        let (report, seconds) = timed(|| body.sweep(&x, &sweep, 1));
        elements = report.expect("the sweep is well formed").elements_cut;
        assert_eq!(body.components().len(), 2, "the plane takes the body apart");
        seconds
    });
    println!("sweep, {elements:5} elements   {:8.3} ms", whole * 1e3);

    let advances = 100;
    let mut slowest = 0.0f64;
    let grown = median(repeats.min(3), || {
        let mut body = uncut.clone();
        let mut x = body.rest_positions();
        let mut sum = 0.0;
        slowest = 0.0;
        for k in 0..=advances {
            let sweep =
                BladeSweep { segments: vec![blade(-0.01 + 0.12 * f64::from(k) / f64::from(advances))] };
            let (report, seconds) = timed(|| body.sweep(&x, &sweep, 1));
            for new in report.expect("the sweep is well formed").new_copies {
                x.push(x[new.parent as usize]);
            }
            sum += seconds;
            slowest = slowest.max(seconds);
        }
        assert_eq!(body.components().len(), 2, "the plane takes the body apart");
        sum / f64::from(advances)
    });
    println!("one advance of {advances}      {:8.3} ms, slowest {:.3} ms", grown * 1e3, slowest * 1e3);
}

/// The result of the work and the seconds it took.
#[allow(clippy::disallowed_methods, reason = "a benchmark reads the clock; the library does not")]
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

fn median(repeats: usize, mut run: impl FnMut() -> f64) -> f64 {
    let mut seconds: Vec<f64> = (0..repeats).map(|_| run()).collect();
    seconds.sort_by(f64::total_cmp);
    seconds[repeats / 2]
}

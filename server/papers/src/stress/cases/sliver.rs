//! Case 1: a cut that leaves almost nothing on one side of an element.

use scindo_study::report::view;
use scindo_study::words::compact;

use super::support::{DOWN, L, SOFT, V, clamp_left, cube, pieces, slice};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 1.
pub(super) const CASE: Case = Case {
    number: Some(1),
    name: "sliver",
    title: "Slivers down to a volume fraction of 1e-15",
    set_up: "A clamped cube of 1296 tetrahedra (6 × 6 × 6 cells), cut half through by a plane just beside a \
             layer of nodes, so that the smallest pieces are 1e-3, 1e-6, 1e-9, 1e-12 and 1e-15 of their \
             elements. Gravity, steps of 20 ms, 500 of them; block-Jacobi PCG to 1e-4.",
    rule: "C. At most 1.5 times the iterations of the uncut cube. No copy is ever faster than twice the \
           fastest material.",
    source: "Jeřábková 2007, Fig. 3.9",
    quick: false,
    run,
};

const FRACTIONS: [f64; 5] = [1e-3, 1e-6, 1e-9, 1e-12, 1e-15];
const STEPS: usize = 500;

fn run(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut uncut = 0;
    for fraction in [None].into_iter().chain(FRACTIONS.map(Some)) {
        let mut body = setting.body(cube(6), SOFT, 500, 1e-4)?;
        clamp_left(&mut body)?;
        let name = fraction.map_or("uncut".to_owned(), compact);
        let mut watch = Watch::new(name.clone(), body, 0.02, DOWN);
        if let Some(fraction) = fraction {
            // A tetrahedron with one node beyond the plane keeps the volume fraction t³ there, and t of each
            // edge.
            let at = 0.5 + fraction.cbrt() / 6.0;
            watch.cut(&slice(at, -5.0, 0.5), 1)?;
            let least = pieces(&watch.body).map(|(p, _)| p.fraction).fold(1.0, f64::min);
            evidence.at_most(
                format!("smallest piece of the cut meant to leave {}", compact(fraction)),
                (least / fraction - 1.0).abs(),
                0.1,
                "off",
            );
        }
        let (mut most, mut copy, mut material) = (0, 0.0_f64, 0.0_f64);
        for _ in 0..STEPS {
            most = most.max(watch.step().iterations);
            let v = watch.body.velocities();
            let vertices = &watch.body.surface().vertices;
            copy = v.iter().map(V::norm).fold(copy, f64::max);
            material = vertices.iter().map(|vertex| vertex.position(v).norm()).fold(material, f64::max);
        }
        match fraction {
            None => {
                uncut = most;
                evidence.tell("largest number of iterations of a step, uncut", f64::from(most), "");
            }
            Some(_) => {
                let ratio = f64::from(most) / f64::from(uncut);
                evidence.at_most(format!("iterations with {name}, over uncut"), ratio, 1.5, "");
                evidence.at_most(
                    format!("fastest copy over fastest material, {name}"),
                    copy / material,
                    2.0,
                    "",
                );
            }
        }
        let body = watch.finish(&mut common, &mut energies, &mut iterations);
        if fraction == Some(1e-9) {
            evidence.pictures.push(view::body(
                &body,
                format!("Cut {} of an edge beside a layer of nodes, after 10 s", compact(1e-3 * L / L)),
            ));
        }
    }
    energies.lines.retain(|line| line.name.contains("uncut") || line.name.contains("e-15"));
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

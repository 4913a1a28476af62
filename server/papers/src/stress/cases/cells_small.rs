//! Cases 1, 5, 7 and 10 on octree cells: cuts that pass next to nothing beside the centres of cells, links cut in
//! their exact middle, a single cell cut free, and a cut that grows by a tenth of a cell.
//!
//! Cells are never divided by a cut, so nothing smaller than a finest cell can come loose. What these cases show
//! on tetrahedra as tiny pieces is here a single cell, or a link that is cut beside its end.

use scindo_physics::body::Body;
use scindo_physics::cut::BladeSweep;
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_study::report::view;
use scindo_study::words::compact;

use super::cells::{body, cells, volume_error};
use super::flaws::tell;
use super::growth::{largest_change, measure, wound};
use super::support::{DOWN, L, SOFT, V, clamp_left, nodes, plane, slice};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 1 on cells.
pub(super) const SLIVER: Case = Case {
    number: None,
    name: "cells-sliver",
    title: "Octree cells: blades that pass 1e-3 to 1e-15 of a cell beside centres",
    set_up: "A clamped cube of 0.1 m, 12 finest cells across and two levels, is cut half through by a plane just \
             beside a layer of cell centres, so that links are cut 1e-3, 1e-6, 1e-9, 1e-12 and 1e-15 of a cell from \
             their ends, and 0.25 for comparison. Gravity, steps of 20 ms, 20 of them; PCG to 1e-4.",
    rule: "C. At most 1.05 times the iterations with a blade a quarter of a cell away, and 1.5 times those of the uncut \
           cube. No vertex is ever faster than twice the fastest \
           point of the surface, and none is lighter than an eighth of a finest cell. The surface is closed.",
    source: "case 1; Jeřábková 2007, Fig. 3.9",
    quick: true,
    run: slivers,
};

/// Case 5 on cells.
pub(super) const HALVED: Case = Case {
    number: None,
    name: "cells-halved-links",
    title: "Octree cells: every link cut in its exact middle",
    set_up: "A cube of 0.1 m, 12 finest cells across and two levels, is cut by a plane through the middle of every \
             link that it meets and by an oblique one. Then the same with the axes exchanged in turn, so that cells \
             and vertices have other numbers, and once more as before.",
    rule: "Same numbers of parts, cells, vertices and triangles with any order of the axes, and the same bits when \
           repeated; halves to 1e-12; the surface is closed.",
    source: "case 5; Nienhuys 2003, §3.2.1",
    quick: true,
    run: halved,
};

/// Case 7 on cells.
pub(super) const FREED: Case = Case {
    number: None,
    name: "cells-freed-cell",
    title: "Octree cells: a single cell is cut free",
    set_up: "Five small blades cut the links of one finest cell in the middle of the upper face of a clamped cube, \
             12 cells across; gravity pulls it out for 0.4 s. Then the same of a cell inside the cube, with six \
             blades.",
    rule: "C. One part besides the rest, one cell large; its momentum is density × volume × g × time and its fall \
           that of a point, both to 1e-6.",
    source: "case 7; Molino, Bao, Fedkiw 2004",
    quick: true,
    run: freed,
};

/// Case 10 on cells.
pub(super) const ADVANCE: Case = Case {
    number: None,
    name: "cells-tenth-of-a-cell",
    title: "Octree cells: a cut that grows by a tenth of a cell per tick",
    set_up: "A block of 10 × 4 × 3 cells, its lower face clamped, gravity pulling its upper half sideways and up. A \
             blade advances by a tenth of a cell per step of 10 ms, from one end to the other.",
    rule: "C. One part until the blade has passed the links of the last cell but one; lips never lose a triangle, and \
           the wound is never more than one cell behind the blade. Cutting changes mass, momentum, angular momentum and both energies by at most 1e-12 at every tick.",
    source: "case 10; Jeřábková 2007, §4.1.3",
    quick: true,
    run: advance,
};

const FRACTIONS: [f64; 6] = [0.25, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15];
/// Finest cells across.
const ACROSS: u32 = 12;
/// Side of a finest cell [m].
const H: f64 = L / ACROSS as f64;

fn slivers(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let (mut uncut, mut ordinary, mut surface) = (0, 0, 0);
    for fraction in [None].into_iter().chain(FRACTIONS.map(Some)) {
        let mut body = body(cells(ACROSS, 2)?, setting, 500, 1e-4)?;
        clamp_left(&mut body)?;
        let name = fraction.map_or("uncut".to_owned(), compact);
        let mut watch = Watch::new(name.clone(), body, 0.02, DOWN);
        if let Some(fraction) = fraction {
            let opened = watch.cut(&slice((6.5 + fraction) / f64::from(ACROSS), -5.0, 0.5), 1)?.faces_opened;
            evidence.exactly(format!("links cut, {name}"), opened, 72);
            surface += watch.body.flaws().surface;
        }
        let (mut most, mut vertex, mut material) = (0, 0.0_f64, 0.0_f64);
        for _ in 0..20 {
            most = most.max(watch.step().iterations);
            let v = watch.body.velocities();
            let points = &watch.body.surface().vertices;
            vertex = v.iter().map(V::norm).fold(vertex, f64::max);
            material = points.iter().map(|point| point.position(v).norm()).fold(material, f64::max);
        }
        if fraction.is_none() {
            uncut = most;
            evidence.tell("largest number of iterations of a step, uncut", f64::from(most), "");
        } else {
            ordinary = if ordinary == 0 { most } else { ordinary };
            for (of, than, at_most) in [(uncut, "uncut", 1.5), (ordinary, "with 0.25", 1.05)] {
                let ratio = f64::from(most) / f64::from(of);
                evidence.at_most(format!("iterations with {name}, over {than}"), ratio, at_most, "");
            }
            evidence.at_most(
                format!("fastest vertex over fastest material, {name}"),
                vertex / material,
                2.0,
                "",
            );
            let eighth = SOFT.density_kg_m3 * H.powi(3) / 8.0;
            let lightest = watch.body.masses().iter().fold(f64::INFINITY, |a, b| a.min(*b));
            evidence.at_least(
                format!("lightest vertex, {name}"),
                lightest / eighth,
                1.0 - 1e-9,
                "eighths of a cell",
            );
        }
        let body = watch.finish(&mut common, &mut energies, &mut iterations);
        if fraction == Some(1e-9) {
            evidence.pictures.push(view::body(&body, "Cut 1e-9 of a cell beside centres, after 0.4 s"));
        }
    }
    evidence.exactly("defects of the surfaces", surface, 0);
    energies.lines.retain(|line| line.name.contains("uncut") || line.name.contains("e-15"));
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn halved(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let (mut found, mut surfaces) = (Vec::new(), Vec::new());
    let (mut defects, mut volume, mut half) = (0, 0.0_f64, 0.0_f64);
    for turns in [0, 1, 2, 0] {
        // x, y, z → y, z, x, so many times.
        let turned = |v: V| (0..turns).fold(v, |v, _| V::new(v.z, v.x, v.y));
        let mut body = body(cells(ACROSS, 2)?, setting, 50, 1e-3)?;
        body.cut(&plane(V::repeat(0.5 * L), turned(V::x()), 5.0 * L), 1)?;
        let largest = body.components().volume.into_iter().fold(0.0, f64::max);
        half = half.max((largest / (0.5 * L.powi(3)) - 1.0).abs());
        let oblique = plane(turned(V::new(0.52, 0.47, 0.55)) * L, turned(V::new(0.3, -0.7, 0.9)), 5.0 * L);
        body.cut(&oblique, 2)?;
        defects += body.flaws().surface;
        volume = volume.max(volume_error(&body));
        let counts = [body.components().len(), body.n_elements(), body.n_copies()];
        found.push((counts, body.surface().triangles.len()));
        surfaces.push(body.surface().clone());
    }
    evidence.at_most("a half of the cube against its volume", half, 1e-12, "off");
    evidence.tell("parts after both planes", found[0].0[0] as f64, "");
    for (k, what) in ["parts", "cells", "vertices"].into_iter().enumerate() {
        let most = found.iter().map(|(counts, _)| counts[k].abs_diff(found[0].0[k])).max().unwrap_or(0);
        evidence.exactly(format!("largest difference of {what} between orders of the axes"), most, 0);
    }
    let most = found.iter().map(|(_, triangles)| triangles.abs_diff(found[0].1)).max().unwrap_or(0);
    evidence.exactly("largest difference of triangles between orders of the axes", most, 0);
    let same = surfaces[0] == surfaces[3];
    evidence.exactly("bits of the surface that differ when repeated", usize::from(!same), 0);
    evidence.exactly("defects of the surfaces", defects, 0);
    evidence.at_most("largest error of the volume", volume, 1e-12, "");
    Ok(evidence)
}

fn freed(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    for (name, layer) in [("on the upper face", ACROSS - 1), ("inside", 6)] {
        let mut body = body(cells(ACROSS, 2)?, setting, 400, 1e-6)?;
        clamp_left(&mut body)?;
        let mut watch = Watch::new(name, body, 0.01, -DOWN);
        let centre = V::new(6.5, f64::from(layer) + 0.5, 6.5) * H;
        for axis in [V::x(), V::y(), V::z()] {
            for side in [-0.5, 0.5] {
                // On the upper face one of the six meets no tissue.
                watch.cut(&plane(centre + side * H * axis, axis, 0.3 * H), 1)?;
            }
        }
        evidence.exactly(format!("parts, {name}"), watch.body.parts().len(), 2);
        evidence.exactly(format!("defects of the surface, {name}"), watch.body.flaws().surface, 0);
        let Some(part) = watch.body.parts().free.iter().position(|free| *free) else {
            return Err("no part is free".into());
        };
        let start = state_of(&watch.body, part);
        watch.steps(40);
        let end = state_of(&watch.body, part);
        let weighed = SOFT.density_kg_m3 * H.powi(3);
        evidence.at_most(
            format!("mass of the cell against density × volume, {name}"),
            (end.0 / weighed - 1.0).abs(),
            1e-12,
            "off",
        );
        let due = -0.4 * weighed * DOWN;
        evidence.at_most(
            format!("deviation of its momentum from density × volume × g × time, {name}"),
            (end.2 - start.2 - due).norm() / due.norm(),
            1e-6,
            "off",
        );
        // The sum that implicit Euler makes.
        let way = -1e-4 * 40.0 * 41.0 / 2.0 * DOWN;
        evidence.at_most(
            format!("deviation of its fall from free fall, {name}"),
            (end.1 - start.1 - way).norm() / way.norm(),
            1e-6,
            "off",
        );
        let body = watch.finish(&mut common, &mut energies, &mut iterations);
        evidence.pictures.push(view::body(&body, format!("A cell {name} cut free, after 0.4 s")));
    }
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

/// Mass, centre and momentum of a part.
fn state_of(body: &Body, part: usize) -> (f64, V, V) {
    let mut sum = (0.0, V::zeros(), V::zeros());
    for (c, _) in body.parts().of_copy.iter().enumerate().filter(|(_, of)| **of as usize == part) {
        let m = body.masses()[c];
        sum = (sum.0 + m, sum.1 + m * body.positions()[c], sum.2 + m * body.velocities()[c]);
    }
    (sum.0, sum.1 / sum.0, sum.2)
}

fn advance(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let cell = 0.01;
    let shape = BoxShape { min: V::zeros(), max: V::new(10.0, 3.0, 4.0) * cell };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 10, levels: 0 }, &|_| 0)?;
    let mut body = body(octree, setting, 300, 1e-6)?;
    let clamp = nodes(body.rest_positions(), |X| X.z == 0.0);
    body.fix(&clamp, [true; 3], V::zeros())?;
    let mut watch = Watch::new("", body, 0.01, V::new(-2.0, 0.0, 9.0));
    let height = 2.03 * cell;
    let blade = |x: f64| [V::new(x, -10.0 * cell, height), V::new(x, 13.0 * cell, height)];
    let (mut early, mut shrunk, mut lag, mut change, mut lips) = (0, 0, 0.0_f64, 0.0_f64, 0);
    for tick in 0..=120 {
        let x = (f64::from(tick) - 8.0) * 0.1 * cell;
        let before = measure(&watch.body);
        watch.cut(&BladeSweep { segments: vec![blade(x)] }, 1)?;
        let after = measure(&watch.body);
        change = largest_change(&before, &after, 10.0 * cell).max(change);
        let (_, reach) = wound(&watch.body);
        let now = watch.body.surface().tags.iter().filter(|tag| **tag > 0).count();
        shrunk += usize::from(now < lips);
        lips = now;
        early += usize::from(x < 9.0 * cell && watch.body.parts().len() > 1);
        if x > 0.5 * cell && x < 10.0 * cell {
            lag = lag.max((x - reach) / cell);
        }
        watch.step();
        if tick == 70 {
            evidence.pictures.push(view::body(&watch.body, "The blade has come two thirds of the way"));
        }
    }
    evidence.exactly("ticks with more than one part before the blade is nearly through", early, 0);
    evidence.exactly("parts at the end", watch.body.parts().len(), 2);
    evidence.exactly("ticks at which lips lost triangles", shrunk, 0);
    evidence.at_most("largest distance of the wound behind the blade", lag, 1.0, "cells");
    evidence.at_most("largest change of mass, momenta and energies by a tick", change, 1e-12, "");
    tell(&watch.body.flaws(), &mut evidence);
    watch.finish(&mut common, &mut energies, &mut iterations);
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

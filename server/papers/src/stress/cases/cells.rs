//! Cases 2 to 13 on octree cells, whose links are cut: where blades meet corners, edges and faces of cells exactly,
//! random and branching cuts, growing and repeated ones, moving tissue, and what falls.

use std::collections::BTreeMap;

use scindo_physics::body::{Body, BodySettings, PcgSettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::octree::{AdaptSettings, BoxShape, Octree, OctreeError, OctreeSettings};
use scindo_physics::space::OctreeSpace;
use scindo_physics::team::Team;
use scindo_study::report::view;
use scindo_study::trial::random::Random;

use super::flaws::tell;
use super::support::{DOWN, L, SOFT, V, clamp_left, plane, slice};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Cases 2 to 5 on cells.
pub(super) const ALIGNED: Case = Case {
    number: None,
    name: "cells-on-lattice",
    title: "Octree cells: blades exactly on corners, edges, faces and centres",
    set_up: "A cube of 0.1 m, 16 finest cells across and two levels of coarser ones, is cut through by planes \
             along its cell faces, through cell centres, and diagonally through edges and through corners; each \
             also shifted by ±1e-9 of a cell. One side is clamped; three steps of 10 ms under gravity.",
    rule: "C. Two parts every time, whose volumes add up to 1e-12. The surface is closed and 2-manifold. Links are \
           cut in one layer: as many as cells touch the plane from one side. A shift along faces changes no link, \
           and the motion by at most 1e-6 of the edge.",
    source: "cases 2 to 5; Dick 2011, §4.3",
    quick: true,
    run: aligned,
};

/// Cases 6 and 9 on cells.
pub(super) const BRANCHES: Case = Case {
    number: None,
    name: "cells-branches",
    title: "Octree cells: random and branching cuts",
    set_up: "Twenty random plane squares cut a cube of 12 cells across, one after the other; then cuts in the form \
             of a T, an X and a Y, and after the T one of a single part.",
    rule: "The parts are those found by walking from cell to cell over whole links, and those of shared vertices. \
           Every part has its volume, the surface is closed and 2-manifold after each cut, T, X and Y give 3, 4 \
           and 3 parts, and the T with one of them cut 4.",
    source: "cases 6 and 9; Sifakis 2007",
    quick: true,
    run: branches,
};

/// Cases 7, 8 and 13 on cells.
pub(super) const FALLING: Case = Case {
    number: None,
    name: "cells-free-fall",
    title: "Octree cells: every fragment falls with g",
    set_up: "A cube of 16 cells across is sliced into four by three cuts, one slice a single cell thick; all free, \
             then with one side clamped. 0.3 s under gravity in steps of 10 ms.",
    rule: "C. The momentum of every free fragment is density × volume × g × time to 1e-6.",
    source: "cases 7, 8 and 13",
    quick: true,
    run: falling,
};

/// Cases 10 to 12 on cells.
pub(super) const GROWTH: Case = Case {
    number: None,
    name: "cells-growing-cut",
    title: "Octree cells: a cut through moving tissue grows tick by tick",
    set_up: "A cube of 16 cells across flies, turns and shakes; a blade crosses it in 150 ticks of 1 ms. Then the \
             last sweep is repeated fifty times.",
    rule: "C. One part until the blade has passed, then two; the surface stays closed. Repeating the sweep adds no \
           cell, vertex or triangle.",
    source: "cases 10, 11 and 12; Nienhuys 2003, §3.3",
    quick: true,
    run: growing,
};

/// Cells that are divided and joined while the body moves and is cut.
pub(super) const ADAPTING: Case = Case {
    number: None,
    name: "cells-adapting",
    title: "Octree cells: divided near a probe and joined behind it, in tissue that moves and is cut",
    set_up: "A cube of 24 cells across and three levels flies, turns and shakes without gravity. A probe goes to \
             and fro through its middle; cells closer than 0.15 edges to it are divided, those farther than 0.25 \
             are joined. Every 20 of 60 ticks of 1 ms a random plane square cuts the cube.",
    rule: "C. Adaptation keeps mass and momentum to 1e-12 and leaves the surface closed. With the probe gone the \
           cells are joined again within four rounds. Energy counts without what adaptation changes and reports.",
    source: "Bangerth 2003, §4; cases 6 and 10",
    quick: true,
    run: adapting,
};

/// A cube of 0.1 m as octree cells.
pub(super) fn cells(across: u32, levels: u8) -> Result<Octree, OctreeError> {
    let shape = BoxShape { min: V::zeros(), max: V::repeat(L) };
    Octree::fill(&shape, OctreeSettings { cells: across, levels }, &|_| 0)
}

/// A body of these cells with this bound of iterations and tolerance.
pub(super) fn body(
    octree: Octree,
    setting: &Setting,
    iterations: u32,
    tolerance: f64,
) -> Result<Body, Trouble> {
    let solver = PcgSettings { iterations, tolerance };
    let settings = BodySettings { solver, ablation: setting.ablation, ..BodySettings::default() };
    Ok(Body::of_space(Box::new(OctreeSpace::new(octree)), SOFT, settings)?)
}

/// Deviation of the volumes of all parts from that of the cube, relative.
pub(super) fn volume_error(body: &Body) -> f64 {
    (body.components().volume.iter().sum::<f64>() / L.powi(3) - 1.0).abs()
}

fn aligned(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let h = L / 16.0;
    let planes = [
        ("cell faces", V::repeat(8.0 * h), V::x(), Some(256)),
        ("cell centres", V::repeat(8.5 * h), V::y(), Some(256)),
        ("edges", V::new(0.5, 0.5, 0.5) * L, V::new(1.0, 1.0, 0.0), None),
        ("corners", V::new(0.5, 0.5, 0.5) * L, V::new(1.0, 1.0, 1.0), None),
    ];
    let (mut surface, mut volume, mut parts, mut layers) = (0, 0.0_f64, 0, 0);
    let (mut moved, mut apart_by_shift) = (Vec::new(), 0.0_f64);
    for (name, through, normal, expected) in planes {
        for shift in [0.0, 1e-9, -1e-9] {
            let mut body = body(cells(16, 2)?, setting, 400, 1e-6)?;
            clamp_left(&mut body)?;
            let mut watch = Watch::new(name, body, 0.01, DOWN);
            let blade = plane(through + shift * h * normal.normalize(), normal, 5.0 * L);
            let report = watch.cut(&blade, 1)?;
            parts += usize::from(watch.body.components().len() != 2);
            volume = volume.max(volume_error(&watch.body));
            surface += watch.body.flaws().surface;
            layers += usize::from(expected.is_some_and(|links| links != report.faces_opened));
            watch.steps(3);
            if shift == 0.0 {
                evidence.tell(format!("links cut, plane through {name}"), report.faces_opened as f64, "");
                moved = watch.body.positions().to_vec();
            } else if name == "cell faces" {
                let apart = moved.iter().zip(watch.body.positions()).map(|(a, b)| (a - b).norm());
                apart_by_shift = apart.fold(apart_by_shift, f64::max);
            }
            watch.finish(&mut common, &mut energies, &mut iterations);
        }
    }
    evidence.at_most("motion that a shift along faces changes, in edges", apart_by_shift / L, 1e-6, "");
    evidence.exactly("cuts that do not leave two parts", parts, 0);
    evidence.exactly("cuts along the lattice that open more or fewer links than one layer", layers, 0);
    evidence.exactly("defects of the surfaces", surface, 0);
    evidence.at_most("largest error of the volume", volume, 1e-12, "");
    common.tell(&mut evidence);
    Ok(evidence)
}

/// Parts by shared vertices.
pub(super) fn parts_by_vertices(octree: &Octree) -> usize {
    let mut root: Vec<usize> = (0..octree.cells().len()).collect();
    fn find(root: &[usize], mut i: usize) -> usize {
        while root[i] != i {
            i = root[i];
        }
        i
    }
    let mut first: BTreeMap<u32, usize> = BTreeMap::new();
    for (id, vertices) in octree.vertices().iter().enumerate() {
        for v in vertices {
            let other = *first.entry(*v).or_insert(id);
            let (a, b) = (find(&root, other), find(&root, id));
            root[a.max(b)] = a.min(b);
        }
    }
    (0..root.len()).filter(|&i| find(&root, i) == i).count()
}

fn branches(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut random = Random(7);
    let (mut defects, mut apart, mut volume) = (0, 0, 0.0_f64);
    let mut cut = body(cells(12, 2)?, setting, 50, 1e-3)?;
    // The same cuts on an octree of their own, to count by.
    let (mut team, mut counted) = (Team::alone(), OctreeSpace::new(cells(12, 2)?));
    for incision in 1..=20 {
        let (through, normal) = (random.vector(0.3 * L), random.vector(1.0) + V::repeat(1e-3));
        let blade = plane(V::repeat(0.5 * L) + through, normal, 0.45 * L);
        cut.cut(&blade, incision)?;
        let x = scindo_physics::space::Space::rest_positions(&counted);
        scindo_physics::space::Space::cut(&mut counted, &mut team, &x, &blade, incision)?;
        let [links, vertices] = [cut.components().len(), parts_by_vertices(counted.octree())];
        apart += links.abs_diff(vertices) + links.abs_diff(cut.parts().len());
        defects += cut.flaws().surface;
        volume = volume.max(volume_error(&cut));
    }
    evidence.tell("parts after twenty random cuts", cut.components().len() as f64, "");
    evidence.exactly("difference between parts by links and by vertices", apart, 0);
    evidence.exactly("defects of the surfaces", defects, 0);
    evidence.at_most("largest error of the volume", volume, 1e-12, "");
    evidence.pictures.push(view::body(&cut, "After twenty random cuts"));
    let middle = V::repeat(0.503 * L);
    let half = |normal: V, along: V| {
        // Half of a plane through the middle, on the side of `along`.
        let w = normal.cross(&along).normalize() * 5.0 * L;
        let far = middle + along.normalize() * 5.0 * L;
        BladeSweep { segments: vec![[middle - w, middle + w], [far - w, far + w]] }
    };
    let ray = |angle: f64| {
        let along = V::new(angle.cos(), angle.sin(), 0.0);
        half(V::new(-angle.sin(), angle.cos(), 0.0), along)
    };
    let shapes: [(&str, &[f64], usize); 4] = [
        ("T", &[0.0, 90.0, 180.0], 3),
        ("T with a part that is cut again", &[0.0, 90.0, 180.0, 45.0], 4),
        ("X", &[10.0, 100.0, 190.0, 280.0], 4),
        ("Y", &[30.0, 150.0, 270.0], 3),
    ];
    for (name, angles, expected) in shapes {
        let mut cut = body(cells(16, 2)?, setting, 50, 1e-3)?;
        for (incision, angle) in (1..).zip(angles) {
            cut.cut(&ray(angle.to_radians()), incision)?;
        }
        evidence.exactly(format!("parts of a {name}"), cut.components().len(), expected);
        evidence.exactly(format!("defects of the surface of a {name}"), cut.flaws().surface, 0);
        evidence.pictures.push(view::surface(
            cut.surface(),
            cut.rest_positions(),
            V::z(),
            format!("A {name}, at rest"),
        ));
    }
    Ok(evidence)
}

fn falling(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    for (name, clamped) in [("all free", false), ("one clamped", true)] {
        let mut body = body(cells(16, 2)?, setting, 400, 1e-6)?;
        if clamped {
            let held: Vec<u32> =
                (0..).zip(body.rest_positions()).filter(|(_, X)| X.x == 0.0).map(|(n, _)| n).collect();
            body.fix(&held, [true; 3], V::zeros())?;
        }
        let mut watch = Watch::new(name, body, 0.01, DOWN);
        // Cell faces lie at sixteenths: the middle slice is one cell thick.
        for (incision, at) in [(1, 0.25), (2, 0.3125), (3, 0.77)] {
            watch.cut(&slice(at, -5.0, 5.0), incision)?;
        }
        let momenta = |body: &Body| {
            let mut sums = vec![(0.0, V::zeros()); body.parts().len()];
            for (c, &part) in body.parts().of_copy.iter().enumerate() {
                sums[part as usize].0 += body.masses()[c];
                sums[part as usize].1 += body.masses()[c] * body.velocities()[c];
            }
            sums
        };
        evidence.exactly(format!("parts, {name}"), watch.body.components().len(), 4);
        watch.steps(30);
        let mut worst = 0.0_f64;
        let free = watch.body.parts().free.clone();
        for ((mass, momentum), _) in momenta(&watch.body).into_iter().zip(&free).filter(|(_, free)| **free) {
            worst = worst.max((momentum / mass - DOWN * 0.3).norm() / (DOWN * 0.3).norm());
        }
        evidence.exactly(
            format!("free fragments, {name}"),
            free.iter().filter(|free| **free).count(),
            if clamped { 3 } else { 4 },
        );
        evidence.at_most(format!("deviation of a fragment's velocity from g t, {name}"), worst, 1e-6, "off");
        tell(&watch.body.flaws(), &mut evidence);
        let body = watch.finish(&mut common, &mut energies, &mut iterations);
        evidence.pictures.push(view::body(&body, format!("{name}, after 0.3 s")));
    }
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn growing(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut body = body(cells(16, 2)?, setting, 400, 1e-6)?;
    let centre = body.centre_of_mass();
    let x = body.positions().to_vec();
    let velocity = |x: &V| {
        let wave = V::new(0.0, 0.0, (50.0 * x.x + 30.0 * x.y).cos());
        V::new(0.0, 1.0, 0.0) + V::new(0.0, 4.0, 0.0).cross(&(x - centre)) + wave
    };
    let v: Vec<V> = x.iter().map(velocity).collect();
    body.set_state(&x, &v)?;
    let mut watch = Watch::new("", body, 1e-3, V::zeros());
    let (mut early, mut defects) = (0, 0);
    let mut last = BladeSweep::default();
    for k in 0..=150 {
        let time = watch.time();
        let at = watch.body.centre_of_mass();
        let s = at.x - 0.75 * L + 1.5 * L * f64::from(k) / 150.0;
        last =
            BladeSweep { segments: vec![[V::new(s, time - 0.5 * L, at.z), V::new(s, time + 1.5 * L, at.z)]] };
        watch.cut(&last, 1)?;
        if k < 120 {
            early += usize::from(watch.body.parts().len() > 1);
        }
        defects += watch.body.flaws().surface;
        if k == 90 {
            evidence.pictures.push(view::body(&watch.body, "On the way through"));
        }
        watch.step();
    }
    evidence.exactly("ticks with more than one part before the blade is nearly through", early, 0);
    evidence.exactly("parts at the end", watch.body.parts().len(), 2);
    evidence.exactly("defects of the surface", defects, 0);
    let count = |body: &Body| [body.n_elements(), body.n_copies(), body.surface().triangles.len()];
    watch.cut(&last, 1)?;
    let first = count(&watch.body);
    for _ in 0..50 {
        watch.cut(&last, 1)?;
    }
    let added: usize = count(&watch.body).iter().zip(first).map(|(now, then)| now.abs_diff(then)).sum();
    evidence.exactly("cells, vertices and triangles added by repeating the last sweep", added, 0);
    let body = watch.finish(&mut common, &mut energies, &mut iterations);
    evidence.pictures.push(view::body(&body, "At the end"));
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn adapting(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut random = Random(11);
    let mut body = body(cells(24, 3)?, setting, 400, 1e-6)?;
    let (centre, coarse) = (body.centre_of_mass(), body.n_elements());
    let velocity = |x: &V| {
        let wave = V::new(0.0, 0.0, (50.0 * x.x + 30.0 * x.y).cos());
        V::new(0.0, 0.5, 0.0) + V::new(0.0, 4.0, 0.0).cross(&(x - centre)) + 0.3 * wave
    };
    let x = body.positions().to_vec();
    let v: Vec<V> = x.iter().map(velocity).collect();
    body.set_state(&x, &v)?;
    let settings = AdaptSettings { distance_m: Some([0.15 * L, 0.25 * L]), ..AdaptSettings::default() };
    let mut watch = Watch::new("", body, 1e-3, V::zeros());
    let (mut defects, mut volume, mut changes, mut most) = (0, 0.0_f64, [0; 2], 0);
    for k in 1..=60 {
        let middle = watch.body.centre_of_mass();
        let probe = middle + V::new(0.6 * L * (f64::from(k) / 15.0).sin(), 0.0, 0.1 * L);
        let done = watch.adapt(&settings, &[probe])?;
        changes = [changes[0] + done.divided, changes[1] + done.joined];
        if k % 20 == 10 {
            let (aside, normal) = (random.vector(0.3 * L), random.vector(1.0) + V::repeat(1e-3));
            watch.cut(&plane(middle + aside, normal, 0.45 * L), k / 20 + 1)?;
        }
        most = most.max(watch.body.n_elements());
        defects += watch.body.flaws().surface;
        volume = volume.max(volume_error(&watch.body));
        watch.step();
        if k == 50 {
            evidence.pictures.push(view::body(&watch.body, "The probe on its way, after three cuts"));
        }
    }
    let far = watch.body.centre_of_mass() + V::repeat(100.0 * L);
    let mut rounds = 0;
    while watch.adapt(&settings, &[far])?.has_changed() && rounds < 10 {
        rounds += 1;
    }
    watch.steps(5);
    let (parts, walked) = (watch.body.parts().len(), watch.body.components().len());
    evidence.tell("cells at first", coarse as f64, "");
    evidence.tell("cells divided", changes[0] as f64, "");
    evidence.tell("groups of cells joined", changes[1] as f64, "");
    evidence.tell("most cells", most as f64, "");
    evidence.tell("cells at the end, fine along the cuts", watch.body.n_elements() as f64, "");
    evidence.exactly("kinds of change that never occurred", changes.iter().filter(|n| **n == 0).count(), 0);
    evidence.exactly("rounds beyond four until all is joined", rounds.max(4) - 4, 0);
    evidence.exactly("difference between parts by links and by vertices", parts.abs_diff(walked), 0);
    evidence.exactly("defects of the surface", defects + watch.body.flaws().surface, 0);
    evidence.at_most("largest error of the volume", volume.max(volume_error(&watch.body)), 1e-12, "");
    let body = watch.finish(&mut common, &mut energies, &mut iterations);
    evidence.pictures.push(view::body(&body, "At the end"));
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

//! Cases 5, 6, 9, 12 and 13: halved edges, random cuts, branches, moving tissue, clamps.

use scindo_physics::cut::{BladeSweep, Flaws, Piece};
use scindo_physics::mesh::TetMesh;
use scindo_study::report::view;
use scindo_study::trial::random::Random;

use super::flaws::{mass_of_parts, tell};
use super::support::{DOWN, L, SOFT, Shaped, V, clamp_left, cube, damped, nodes, plane, slice};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 5.
pub(super) const HALVED: Case = Case {
    number: Some(5),
    name: "halved-edges",
    title: "Every edge cut in its exact middle",
    set_up: "A cube of 3 × 3 × 3 cells with nodes at multiples of ⅛ m, cut by three planes: one through the \
             middle of every edge it meets, one through diagonals, one along a layer of faces. Then the same on \
             the same mesh with nodes and elements numbered backwards.",
    rule: "Same numbers of parts, pieces and copies in any numbering and the same bits when repeated; halves \
           to 1e-12; surface closed.",
    source: "Nienhuys 2003, §3.2.1",
    quick: true,
    run: halved,
};

/// Case 6.
pub(super) const RANDOM: Case = Case {
    number: Some(6),
    name: "random-cuts",
    title: "Twenty random cuts through one ring of elements",
    set_up: "A clamped cube of 162 tetrahedra; twenty random planes through its middle, all within a tenth of \
             its edge, with four steps of 10 ms under gravity after each. Four seeds.",
    rule: "C. Fractions of every element add up to 1; the surface is closed and 2-manifold; the parts of \
           connected material are those connected by shared copies.",
    source: "Sifakis 2007; Ton-That 2024",
    quick: false,
    run: random,
};

/// Case 9.
pub(super) const BRANCHES: Case = Case {
    number: Some(9),
    name: "branches",
    title: "T, X and Y junctions, and a cut inside a piece",
    set_up: "A cube of 750 tetrahedra: a cut that ends on another (T); two that cross (X); a bent one with a \
             third arm that begins half a cell behind its bend (Y); after T, a cut of one piece only.",
    rule: "3, 4, 3 and 4 parts; the surface is closed and 2-manifold; no volume is lost.",
    source: "Jeřábková 2007, Figs. 3.5 and 3.6",
    quick: true,
    run: branches,
};

/// Case 12.
pub(super) const MOVING: Case = Case {
    number: Some(12),
    name: "moving-tissue",
    title: "The tissue moves at 1 m/s while it is cut",
    set_up: "A free cube of 1296 tetrahedra flies at 1 m/s, turns and rings (waves of 1 m/s), while a blade \
             passes through it in 150 steps of 1 ms.",
    rule: "C. One part and one closed surface until the blade is through, two parts then.",
    source: "Nienhuys 2003, §3.3",
    quick: true,
    run: moving,
};

/// Case 13.
pub(super) const CLAMPED: Case = Case {
    number: Some(13),
    name: "cut-at-clamp",
    title: "A cut beside the clamped face",
    set_up: "A cube clamped at one face is cut 4 % of its edge beside that face: all pieces beyond the cut \
             still have clamped nodes, but hold no clamped material. Then a cut through the clamped nodes \
             themselves, so that both halves are clamped; once between layers of nodes and once exactly along \
             one, so that both lips have its clamped nodes.",
    rule: "C. The loose part falls with g to 1e-6, so nothing holds it in the air. Clamped material stays in \
           place, bit for bit, on both lips.",
    source: "Schoch et al. 2013, §5.2",
    quick: true,
    run: clamped,
};

fn halved(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let edge = 0.375;
    let mesh = super::support::block([edge; 3], [3; 3]);
    let mut backwards = mesh.clone();
    backwards.nodes.reverse();
    backwards.tets.reverse();
    let last = mesh.nodes.len() as u32 - 1;
    backwards.tets.iter_mut().flatten().for_each(|n| *n = last - *n);
    let centre = V::repeat(0.5 * edge);
    let mut found = Vec::new();
    let mut flaws = Flaws::default();
    for mesh in [mesh.clone(), backwards, mesh] {
        let mut body = Shaped::new(setting.cut_mesh(mesh)?);
        body.sweep(&plane(centre, V::y(), 2.0 * edge), 1)?;
        let half = 0.5 * edge.powi(3);
        let off = body.volumes().iter().map(|v| (v / half - 1.0).abs()).fold(0.0, f64::max);
        evidence.exactly("parts after the first plane", body.topology()[0], 2);
        evidence.at_most("a half of the cube against its volume", off, 1e-12, "off");
        body.sweep(&plane(centre, V::new(1.0, 1.0, 0.0), 2.0 * edge), 2)?;
        body.sweep(&plane(V::new(0.5, 0.5, 1.0 / 3.0) * edge, V::z(), 2.0 * edge), 3)?;
        flaws.merge(Flaws::of(&body.mesh));
        found.push(body);
    }
    let [there, back, again] = [0, 1, 2].map(|k| found[k].topology());
    for (k, what) in ["parts", "pieces", "copies"].into_iter().enumerate() {
        evidence.exactly(
            format!("{what} numbered backwards, less {what} numbered forwards"),
            back[k].abs_diff(there[k]),
            0,
        );
        evidence.exactly(format!("{what} when repeated, less {what} before"), again[k].abs_diff(there[k]), 0);
    }
    let same = found[0].mesh.surface() == found[2].mesh.surface();
    evidence.exactly("bits of the surface that differ when repeated", usize::from(!same), 0);
    evidence.exactly("parts after all three planes", there[0], 8);
    tell(&flaws, &mut evidence);
    evidence.pictures.push(view::surface(
        found[0].mesh.surface(),
        &apart(found[0].mesh.mesh(), found[0].mesh.pieces(), &found[0].x),
        V::y(),
        "The parts, drawn apart",
    ));
    Ok(evidence)
}

/// Positions with the parts moved apart, for a picture.
fn apart(mesh: &TetMesh, pieces: &[Piece], x: &[V]) -> Vec<V> {
    let middle = x.iter().sum::<V>() / x.len() as f64;
    let mut root: Vec<usize> = (0..x.len()).collect();
    // There are few copies, so it is simplest to propagate labels until none changes.
    loop {
        let mut changed = false;
        for piece in pieces {
            let least = piece.copies.iter().map(|&c| root[c as usize]).min().unwrap_or(0);
            for &copy in &piece.copies {
                changed |= root[copy as usize] != least;
                root[copy as usize] = least;
            }
        }
        if !changed {
            break;
        }
    }
    let mut sums = vec![(V::zeros(), 0.0); x.len()];
    for piece in pieces {
        let centre: V = mesh.corners(piece.element as usize).iter().sum::<V>() / 4.0;
        let weight = piece.fraction * mesh.volume(piece.element as usize);
        let sum = &mut sums[root[piece.copies[0] as usize]];
        *sum = (sum.0 + weight * centre, sum.1 + weight);
    }
    let shift = |c: usize| {
        let (sum, weight) = sums[root[c]];
        if weight > 0.0 { (sum / weight - middle) * 0.25 } else { V::zeros() }
    };
    (0..x.len()).map(|c| x[c] + shift(c)).collect()
}

fn random(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut flaws = Flaws::default();
    for seed in 0..4 {
        let mut random = Random(seed);
        let mut body = setting.body(cube(3), damped(0.5, 0.002), 1000, 1e-4)?;
        clamp_left(&mut body)?;
        let mut watch = Watch::new(format!("seed {seed}"), body, 0.01, DOWN);
        let middle = |watch: &Watch| -> V {
            // The present centre of the clamped part.
            let part = watch.body.parts().free.iter().position(|free| !free).unwrap_or(0);
            let of = |c: &usize| watch.body.parts().of_copy[*c] as usize == part;
            let copies: Vec<usize> = (0..watch.body.positions().len()).filter(of).collect();
            copies.iter().map(|&c| watch.body.positions()[c]).sum::<V>() / copies.len() as f64
        };
        let mut refused = 0;
        for k in 0..20 {
            let point = middle(&watch) + random.vector(0.1 * L);
            let report = watch.cut(&plane(point, random.vector(1.0), 3.0 * L), k + 1)?;
            refused += report.refused_edges;
            flaws.merge(watch.body.flaws());
            watch.steps(4);
        }
        evidence.tell(format!("parts, seed {seed}"), watch.body.parts().len() as f64, "");
        evidence.tell(format!("edges left whole at the cap, seed {seed}"), refused as f64, "");
        evidence.at_most(
            format!("mass of the parts against density × volume, seed {seed}"),
            mass_of_parts(&watch.body),
            1e-9,
            "off",
        );
        let body = watch.finish(&mut common, &mut energies, &mut iterations);
        let cut = body.tets().map(|tets| (tets.mesh(), tets.pieces())).ok_or("a body without tetrahedra")?;
        let drawn = apart(cut.0, cut.1, body.rest_positions());
        evidence.pictures.push(view::surface(
            body.surface(),
            &drawn,
            V::y(),
            format!("Seed {seed}: the parts at rest, drawn apart"),
        ));
    }
    tell(&flaws, &mut evidence);
    energies.lines.truncate(4);
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn branches(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut flaws = Flaws::default();
    // A blade along y at (x, z), in edges of the cube.
    let blade = |(x, z): (f64, f64)| [V::new(x, -1.0, z) * L, V::new(x, 2.0, z) * L];
    let path = |points: &[(f64, f64)]| BladeSweep { segments: points.iter().map(|p| blade(*p)).collect() };
    let (c, s) = (0.5, 0.75_f64.sqrt());
    let arm = |x: f64, z: f64| (0.47 + 2.0 * x, 0.52 + 2.0 * z);
    let shapes: [(&str, usize, Vec<BladeSweep>); 4] = [
        ("T", 3, vec![path(&[(0.43, -1.0), (0.43, 2.0)]), path(&[(0.43, 0.52), (2.0, 0.52)])]),
        ("X", 4, vec![path(&[(0.43, -1.0), (0.43, 2.0)]), path(&[(-1.0, 0.52), (2.0, 0.52)])]),
        ("Y", 3, vec![path(&[arm(-c, s), (0.47, 0.52), arm(-c, -s)]), path(&[(0.37, 0.52), arm(1.0, 0.0)])]),
        (
            "T and a piece",
            4,
            vec![
                path(&[(0.43, -1.0), (0.43, 2.0)]),
                path(&[(0.43, 0.52), (2.0, 0.52)]),
                path(&[(-1.0, 0.3), (0.43, 0.3)]),
            ],
        ),
    ];
    for (name, expected, sweeps) in shapes {
        let mut body = Shaped::new(setting.cut_mesh(cube(5))?);
        for (sweep, incision) in sweeps.iter().zip(1u32..) {
            body.sweep(sweep, incision)?;
        }
        evidence.exactly(format!("parts, {name}"), body.topology()[0], expected);
        flaws.merge(Flaws::of(&body.mesh));
        evidence.pictures.push(view::surface(
            body.mesh.surface(),
            &apart(body.mesh.mesh(), body.mesh.pieces(), &body.x),
            V::z(),
            format!("{name}, drawn apart"),
        ));
    }
    tell(&flaws, &mut evidence);
    evidence.notes.push(
        "The third arm of the Y must extend past the bend. A bent cut is flat within each element, so an arm \
         that begins exactly at the bend can leave a bridge of less than one element."
            .to_owned(),
    );
    Ok(evidence)
}

fn moving(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut body = setting.body(cube(6), SOFT, 300, 1e-6)?;
    let centre = body.centre_of_mass();
    let x = body.positions().to_vec();
    let velocity = |x: &V| {
        let wave = V::new(0.0, 0.0, (50.0 * x.x + 30.0 * x.y).cos());
        V::new(0.0, 1.0, 0.0) + V::new(0.0, 4.0, 0.0).cross(&(x - centre)) + wave
    };
    let v: Vec<V> = x.iter().map(velocity).collect();
    body.set_state(&x, &v)?;
    let mut watch = Watch::new("", body, 1e-3, V::zeros());
    let (mut early, mut torn) = (0, 0);
    for k in 0..=150 {
        let time = watch.time();
        let at = watch.body.centre_of_mass();
        // The blade moves with the flight and also crosses the body from one side to the other.
        let s = at.x - 0.75 * L + 1.5 * L * f64::from(k) / 150.0;
        let blade = [V::new(s, time - 0.5 * L, at.z), V::new(s, time + 1.5 * L, at.z)];
        watch.cut(&BladeSweep { segments: vec![blade] }, 1)?;
        let through = watch.body.parts().len() > 1;
        if k < 120 {
            early += usize::from(through);
            torn += usize::from(watch.body.surface().n_shells() > 1 && !through);
        }
        if k == 90 {
            evidence.pictures.push(view::body(&watch.body, "On the way through"));
        }
        watch.step();
    }
    evidence.exactly("steps with more than one part before the blade is nearly through", early, 0);
    evidence.exactly("steps with more than one closed surface before", torn, 0);
    evidence.exactly("parts at the end", watch.body.parts().len(), 2);
    evidence.tell("fastest material at the start", v.iter().map(V::norm).fold(0.0, f64::max), "m/s");
    tell(&watch.body.flaws(), &mut evidence);
    let body = watch.finish(&mut common, &mut energies, &mut iterations);
    evidence.pictures.push(view::body(&body, "At the end"));
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn clamped(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut flaws = Flaws::default();
    // Beside the clamp.
    let mut body = setting.body(cube(4), SOFT, 200, 1e-5)?;
    let clamp = clamp_left(&mut body)?;
    let mut watch = Watch::new("beside", body, 0.01, DOWN);
    watch.cut(&slice(0.04, -5.0, 5.0), 1)?;
    flaws.merge(watch.body.flaws());
    let free = watch.body.parts().free.iter().filter(|free| **free).count();
    evidence.exactly("free parts, cut beside the clamp", free, 1);
    let fallen = |watch: &Watch| -> (V, f64) {
        let parts = watch.body.parts();
        let loose = parts.free.iter().position(|free| *free).unwrap_or(0);
        let of = |c: &usize| parts.of_copy[*c] as usize == loose;
        let sum = (0..parts.of_copy.len()).filter(of).fold((V::zeros(), 0.0), |(x, m), c| {
            let mass = watch.body.masses()[c];
            (x + mass * watch.body.positions()[c], m + mass)
        });
        (sum.0 / sum.1, sum.1)
    };
    let (start, mass) = fallen(&watch);
    evidence.at_least("mass of the loose part over all", mass / watch.body.total_mass(), 0.9, "");
    watch.steps(20);
    // n steps of implicit Euler fall by h² n (n + 1)/2 g, here with h = 10 ms and n = 20.
    let way = 1e-4 * 20.0 * 21.0 / 2.0 * DOWN;
    let off = (fallen(&watch).0 - start - way).norm() / way.norm();
    evidence.at_most("deviation of its fall from free fall", off, 1e-6, "off");
    let body = watch.finish(&mut common, &mut energies, &mut iterations);
    let rest = body.rest_positions();
    let moved = |body: &scindo_physics::body::Body, clamp: &[u32]| {
        clamp.iter().filter(|&&n| body.positions()[n as usize] != body.rest_positions()[n as usize]).count()
    };
    evidence.exactly("clamped nodes that moved", moved(&body, &clamp), 0);
    evidence.tell("copies", rest.len() as f64, "");
    evidence.pictures.push(view::body(&body, "Cut beside the clamp, after 0.2 s"));
    // Through the clamp.
    let mut body = setting.body(cube(4), damped(0.5, 0.005), 200, 1e-5)?;
    let clamp = nodes(body.rest_positions(), |X| X.y == 0.0);
    body.fix(&clamp, [true; 3], V::zeros())?;
    let mut watch = Watch::new("through", body, 0.01, DOWN);
    watch.cut(&slice(0.55, -5.0, 5.0), 1)?;
    flaws.merge(watch.body.flaws());
    let held = watch.body.parts().free.iter().filter(|free| !**free).count();
    evidence.exactly("clamped parts, cut through the clamp", held, 2);
    watch.steps(50);
    let body = watch.finish(&mut common, &mut energies, &mut iterations);
    evidence.exactly("clamped nodes that moved, cut through the clamp", moved(&body, &clamp), 0);
    // A part that had come loose would be twelve edges below after 0.5 s.
    let low = body.positions().iter().map(|x| x.y).fold(f64::INFINITY, f64::min);
    evidence.at_least("lowest point", low / L, -0.1, "edges");
    // Exactly along a layer of nodes that ends in the clamp.
    let mut body = setting.body(cube(4), damped(0.5, 0.005), 200, 1e-5)?;
    body.fix(&clamp, [true; 3], V::zeros())?;
    let mut watch = Watch::new("along nodes", body, 0.01, DOWN);
    watch.cut(&slice(0.5, -5.0, 5.0), 1)?;
    flaws.merge(watch.body.flaws());
    watch.steps(50);
    let body = watch.finish(&mut common, &mut energies, &mut iterations);
    let copies = body.node_of_copy().iter().zip(body.positions().iter().zip(body.rest_positions()));
    let clamped = copies.filter(|(node, _)| clamp.contains(node));
    let (all, still) =
        clamped.fold((0, 0), |(all, still), (_, (x, X))| (all + 1, still + usize::from(x == X)));
    // The layer has five nodes in the clamp. The cut doubles them, and both copies have to stay.
    evidence.exactly("copies of clamped nodes, cut along nodes", all, clamp.len() + 5);
    evidence.exactly("of these, moved", all - still, 0);
    tell(&flaws, &mut evidence);
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

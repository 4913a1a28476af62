//! Cases 2, 3 and 4: cuts through nodes, along edges and along faces of the mesh.

use nalgebra::Rotation3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, PcgSettings};
use scindo_physics::cut::{BladeSweep, Flaws};
use scindo_physics::mesh::TetMesh;
use scindo_study::report::view;
use scindo_study::words::compact;

use super::flaws::tell;
use super::support::{DOWN, SOFT, Shaped, V, block, nodes, pieces, plane};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 2.
pub(super) const NODE: Case = Case {
    number: Some(2),
    name: "node-on-cut",
    title: "Nodes exactly on the cut",
    set_up: "A clamped cube of 384 tetrahedra with nodes at multiples of 1/32 m. A plane through its middle \
             node in general position, then one through a whole layer of nodes; both also shifted by ± 1e-9 m. \
             A quarter of a second under gravity in double precision.",
    rule: "C. Two parts; volumes add up to 1e-12; the surface is closed; with shifted planes, all material that \
           was not cut moves to the same positions, to 1e-6 of the edge.",
    source: "Wang 2014; Schoch et al. 2013, the cases \"0\"",
    quick: true,
    run: |setting| on_mesh(setting, &[V::new(0.3, -0.7, 0.9), V::new(1.0, 0.0, 0.0), V::new(0.0, 0.0, 1.0)]),
};

/// Case 3.
pub(super) const EDGE: Case = Case {
    number: Some(3),
    name: "edge-on-cut",
    title: "Edges exactly in the cut",
    set_up: "As the case before, with planes through the middle node that hold whole edges and diagonals of the \
             cells: x = y, x + y = 1, x + y = z + ½, 2x = y + z. Then 60 cubes, turned at random and metres \
             away, cut by sweeps of seven blade positions each of which passes through five edges: edges that \
             cross a seam of the sweep must not stay uncut.",
    rule: "As the case before; all of the 60 cubes fall into two parts of the right volume.",
    source: "Schoch et al. 2013, Fig. 6",
    quick: true,
    run: |setting| {
        let normals = [[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, -1.0], [2.0, -1.0, -1.0]];
        let mut evidence = on_mesh(setting, &normals.map(V::from))?;
        seams(setting, &mut evidence)?;
        Ok(evidence)
    },
};

/// Case 4.
pub(super) const FACE: Case = Case {
    number: Some(4),
    name: "face-on-cut",
    title: "A layer of faces in the cut",
    set_up: "The same cube, cut along a layer of faces: through, and half through from the side that is not \
             clamped. The half cut is compared \
             with a mesh whose nodes on the cut were duplicated by hand, as cutting along faces does.",
    rule: "C. No element has two pieces or a vanishing piece; each node of the layer has one more copy; the \
           motion is that of the duplicated mesh, to 1e-9 of the edge.",
    source: "Nienhuys 2003, ch. 3",
    quick: true,
    run: face,
};

/// Edge of the cube [m]. Nodes lie at dyadic numbers, so that "exactly" means exactly.
const EDGE_M: f64 = 0.125;

fn mesh() -> TetMesh {
    block([EDGE_M; 3], [4; 3])
}

fn exact(setting: &Setting, mesh: TetMesh, clamped: fn(&V) -> bool) -> Result<Body, Trouble> {
    let settings = BodySettings {
        solver: PcgSettings { iterations: 2000, tolerance: 1e-11 },
        arithmetic: Some(Arithmetic::Double),
        ..BodySettings::default()
    };
    let mut body = setting.with(mesh, SOFT, settings)?;
    let clamp = nodes(body.rest_positions(), clamped);
    body.fix(&clamp, [true; 3], V::zeros())?;
    Ok(body)
}

/// The face that the half cut does not reach.
fn far_side(X: &V) -> bool {
    X.y == EDGE_M
}

/// Centre of every element that is still one piece; `None` for the others.
fn middles(body: &Body) -> Vec<Option<V>> {
    let mut middle = vec![None; body.n_elements()];
    for (piece, _) in pieces(body).filter(|(piece, _)| piece.fraction == 1.0) {
        let sum: V = piece.copies.iter().map(|&c| body.positions()[c as usize]).sum();
        middle[piece.element as usize] = Some(sum / 4.0);
    }
    middle
}

fn apart(a: &[Option<V>], b: &[Option<V>]) -> f64 {
    let both = a.iter().zip(b).filter_map(|(a, b)| Some((a.as_ref()? - b.as_ref()?).norm()));
    both.fold(0.0, f64::max) / EDGE_M
}

fn on_mesh(setting: &Setting, normals: &[V]) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut flaws = Flaws::default();
    let centre = V::repeat(0.5 * EDGE_M);
    for (k, normal) in normals.iter().enumerate() {
        let name = format!("plane {}", k + 1);
        let mut ends = Vec::new();
        for shift in [0.0, 1e-9, -1e-9] {
            let mut watch = Watch::new(name.clone(), exact(setting, mesh(), |X| X.x == 0.0)?, 0.01, DOWN);
            let point = centre + shift * normal.normalize();
            watch.cut(&plane(point, *normal, 3.0 * EDGE_M), 1)?;
            flaws.merge(watch.body.flaws());
            let parts = watch.body.components();
            evidence.exactly(format!("parts, {name}, shifted by {} m", compact(shift)), parts.len(), 2);
            if shift == 0.0 {
                let sum: f64 = parts.volume.iter().sum();
                evidence.at_most(
                    format!("sum of volumes over that of the cube, {name}"),
                    (sum / EDGE_M.powi(3) - 1.0).abs(),
                    1e-12,
                    "off",
                );
            }
            watch.steps(25);
            ends.push(middles(&watch.body));
            if shift == 0.0 {
                let body = watch.finish(&mut common, &mut energies, &mut iterations);
                evidence.pictures.push(view::body(&body, format!("{name}, after 0.25 s")));
            } else {
                common.merge(&watch.common());
            }
        }
        for (end, shift) in ends[1..].iter().zip([1e-9, -1e-9]) {
            evidence.at_most(
                format!("motion shifted by {} m against unshifted, {name}", compact(shift)),
                apart(&ends[0], end),
                1e-6,
                "edges",
            );
        }
    }
    tell(&flaws, &mut evidence);
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

/// Cubes in general position. Every blade position of the sweep lies exactly across edges of the mesh.
fn seams(setting: &Setting, evidence: &mut Evidence) -> Result<(), Trouble> {
    let mut wrong = 0;
    for seed in 0..60 {
        let s = f64::from(seed);
        let turn = Rotation3::from_euler_angles(0.3 + 0.7 * s, 1.1 + 0.31 * s, -0.7 + 0.53 * s);
        let far = V::new(3.0 + s, -2.0, 1.5);
        let mut body = Shaped::new(setting.cut_mesh(block([1.0; 3], [4; 3]))?);
        body.x.iter_mut().for_each(|x| *x = turn * *x + far);
        let blade = |k: i32| {
            let x = 0.25 * f64::from(k);
            [turn * V::new(x, -1.0, 0.4) + far, turn * V::new(x, 2.0, 0.4) + far]
        };
        body.sweep(&BladeSweep { segments: (-1..=5).map(blade).collect() }, 1)?;
        let volumes = body.volumes();
        let right = volumes.len() == 2 && (volumes[0] - 0.4).abs() < 1e-9;
        wrong += usize::from(!right);
    }
    evidence.exactly("turned cubes, of 60, that do not fall into two parts of the right volume", wrong, 0);
    Ok(())
}

/// A mesh whose nodes at z = ½ and y < `to` (in edges) exist twice, once below and once above.
fn duplicated(to: f64) -> TetMesh {
    let mut mesh = mesh();
    let on = |X: &V| X.z == 0.5 * EDGE_M && X.y < to * EDGE_M;
    let mut twin = vec![None; mesh.nodes.len()];
    for n in nodes(&mesh.nodes, on) {
        twin[n as usize] = Some(mesh.nodes.len() as u32);
        mesh.nodes.push(mesh.nodes[n as usize]);
    }
    for e in 0..mesh.tets.len() {
        let above = mesh.corners(e).iter().map(|X| X.z).sum::<f64>() / 4.0 > 0.5 * EDGE_M;
        for node in mesh.tets[e].iter_mut().filter(|_| above) {
            *node = twin.get(*node as usize).copied().flatten().unwrap_or(*node);
        }
    }
    mesh
}

fn face(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let sweep = |to: f64| {
        let segment = |y: f64| [V::new(-1.0, y, 0.5) * EDGE_M, V::new(2.0, y, 0.5) * EDGE_M];
        BladeSweep { segments: vec![segment(-1.0), segment(to)] }
    };
    let mut whole = Shaped::new(setting.cut_mesh(mesh())?);
    let before = whole.topology();
    whole.sweep(&sweep(2.0), 1)?;
    let [parts, n_pieces, copies] = whole.topology();
    evidence.exactly("parts, cut through", parts, 2);
    evidence.exactly("pieces, cut through", n_pieces, before[1]);
    evidence.exactly("additional copies, cut through", copies - before[2], 25);
    tell(&Flaws::of(&whole.mesh), &mut evidence);
    let least = |body: &Body| {
        let all = pieces(body).map(|(piece, volume)| piece.fraction * volume);
        all.fold(f64::INFINITY, f64::min)
    };

    let mut cut = Watch::new("cut", exact(setting, mesh(), far_side)?, 0.01, DOWN);
    cut.cut(&sweep(0.5), 1)?;
    let twins = duplicated(0.5);
    let by_hand = Watch::new("nodes duplicated", exact(setting, twins, far_side)?, 0.01, DOWN);
    evidence.exactly("copies, cut half through", cut.body.n_copies(), by_hand.body.n_copies());
    evidence.at_least(
        "smallest piece over smallest element",
        least(&cut.body) / least(&by_hand.body),
        1.0 - 1e-12,
        "",
    );
    let mut by_hand = by_hand;
    let mut worst = 0.0_f64;
    for _ in 0..50 {
        cut.step();
        by_hand.step();
        worst = worst.max(apart(&middles(&cut.body), &middles(&by_hand.body)));
    }
    evidence.at_most("motion against that of the duplicated mesh", worst, 1e-9, "edges");
    let body = cut.finish(&mut common, &mut energies, &mut iterations);
    evidence.pictures.push(view::body(&body, "Cut half through along faces, after half a second"));
    by_hand.finish(&mut common, &mut energies, &mut iterations);
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

//! Classifies nodes, finds crossings, warps nodes and splits tets: the lattice becomes tets that end at the
//! surface.

use nalgebra::Vector3;
use rayon::prelude::*;
use scindo_physics::mesh::TetMesh;

use super::LatticeReport;
use super::bcc::{Bcc, Edge};
use crate::mesh_in::health::surface::CleanSurface;

/// Fraction of an edge within which a crossing pulls the node onto the surface.
///
/// # Source
/// Labelle, Shewchuk 2007, Table 1: (0.24999, 0.41189) keeps every dihedral angle above 10.7° if the cut
/// points are consistent. Crossings of real triangles are only nearly consistent.
const ALPHA_LONG: f64 = 0.249_99;
const ALPHA_SHORT: f64 = 0.411_89;

/// Bisections for a crossing without a triangle, to 2⁻²⁰ of an edge.
const BISECTIONS: usize = 20;

/// Nodes between two progress reports.
const PORTION: usize = 1 << 16;
/// Shares of the meshing time after which nodes are classified and edges crossed.
const CLASSIFIED: f64 = 0.25;
const CROSSED: f64 = 0.35;

/// The side of the surface on which a node lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Inside,
    Outside,
    On,
}

/// A lattice edge from inside to outside, with its crossing.
struct Cut {
    edge: Edge,
    /// Crossing point [m].
    point: Vector3<f64>,
    /// Distance of the crossing from the inner node, as a fraction of the edge.
    from_inside: f64,
    inside: u32,
    outside: u32,
    /// Whether no triangle is there.
    in_hole: bool,
}

/// Makes the tetrahedra of the lattice inside the surface.
pub(super) fn stuff(
    lattice: &Bcc,
    surface: &CleanSurface,
    report: &mut LatticeReport,
    tell: &(dyn Fn(&'static str, f64) + Sync),
) -> TetMesh {
    let mut sides = classify(lattice, surface, tell);
    tell("crossings", CLASSIFIED);
    let cuts = cut_edges(lattice, surface, &sides);
    report.hole_crossings = cuts.iter().filter(|c| c.in_hole).count();
    let mut positions: Vec<Vector3<f64>> =
        (0..lattice.n_nodes() as u32).map(|n| lattice.position(n)).collect();
    report.warped_nodes = warp(lattice, &cuts, &mut sides, &mut positions);

    // The remaining crossings become nodes. Edges are bisected in the order of `Crossing::key`.
    let mut crossings: Vec<Crossing> = Vec::new();
    for cut in &cuts {
        if sides[cut.inside as usize] == Side::Inside && sides[cut.outside as usize] == Side::Outside {
            let node = positions.len() as u32;
            positions.push(cut.point);
            sides.push(Side::On);
            let length = (cut.point - positions[cut.inside as usize]).norm();
            crossings.push(Crossing { edge: cut.edge, node, key: (lattice.is_long(cut.edge), length) });
        }
    }
    crossings.sort_unstable_by_key(|c| c.edge);
    tell("tetrahedra", CROSSED);
    report.cut_edges = crossings.len();
    let splitter = Splitter { sides: &sides, crossings: &crossings };
    let mut tets = Vec::new();
    lattice.for_each_tet(|tet| splitter.inner_part(tet, &mut tets));
    let mut mesh = TetMesh { nodes: positions, tets };
    mesh.drop_unused_nodes();
    mesh
}

/// A point is inside if its winding number is above ½.
fn is_inside(surface: &CleanSurface, point: &Vector3<f64>) -> bool {
    surface.tree.winding_number(point) > 0.5
}

fn classify(lattice: &Bcc, surface: &CleanSurface, tell: &(dyn Fn(&'static str, f64) + Sync)) -> Vec<Side> {
    let n_nodes = lattice.n_nodes();
    let mut sides = Vec::with_capacity(n_nodes);
    for start in (0..n_nodes).step_by(PORTION) {
        let portion = start as u32..(start + PORTION).min(n_nodes) as u32;
        let side = |n| if is_inside(surface, &lattice.position(n)) { Side::Inside } else { Side::Outside };
        sides.par_extend(portion.into_par_iter().map(side));
        tell("inside and outside", CLASSIFIED * sides.len() as f64 / n_nodes as f64);
    }
    sides
}

fn cut_edges(lattice: &Bcc, surface: &CleanSurface, sides: &[Side]) -> Vec<Cut> {
    let edges = lattice.edges(|e| sides[e.a as usize] != sides[e.b as usize]);
    edges
        .par_iter()
        .map(|&edge| {
            let a_inside = sides[edge.a as usize] == Side::Inside;
            let (inside, outside) = if a_inside { (edge.a, edge.b) } else { (edge.b, edge.a) };
            let (p, q) = (lattice.position(inside), lattice.position(outside));
            let (from_inside, in_hole) = crossing(surface, &p, &q);
            Cut { edge, point: p + from_inside * (q - p), from_inside, inside, outside, in_hole }
        })
        .collect()
}

/// Parameter at which the segment from `p` inside to `q` outside leaves the body, and whether that is in a
/// hole.
fn crossing(surface: &CleanSurface, p: &Vector3<f64>, q: &Vector3<f64>) -> (f64, bool) {
    let hits = surface.tree.crossings(p, q);
    let at = |t: f64| p + t * (q - p);
    // Of several hits, take the first behind which the point is outside.
    for (i, &(t, _)) in hits.iter().enumerate() {
        let next = hits.get(i + 1).map_or(1.0, |h| h.0);
        let is_last = i + 1 == hits.len();
        if (is_last && hits.len() == 1) || (next - t > 1e-9 && !is_inside(surface, &at(0.5 * (t + next)))) {
            return (t, false);
        }
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if is_inside(surface, &at(middle)) { low = middle } else { high = middle }
    }
    // A node on the surface may be classified either way, which is not a hole.
    (0.5 * (low + high), low > 0.0 && high < 1.0)
}

/// Moves nodes close to a crossing onto it, the closest first. Returns the number moved.
fn warp(lattice: &Bcc, cuts: &[Cut], sides: &mut [Side], positions: &mut [Vector3<f64>]) -> usize {
    let mut pulls: Vec<(f64, u32, usize)> = Vec::new();
    for (i, cut) in cuts.iter().enumerate() {
        let alpha = if lattice.is_long(cut.edge) { ALPHA_LONG } else { ALPHA_SHORT };
        if cut.from_inside < alpha {
            pulls.push((cut.from_inside, cut.inside, i));
        }
        if 1.0 - cut.from_inside < alpha {
            pulls.push((1.0 - cut.from_inside, cut.outside, i));
        }
    }
    pulls.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)).then(x.2.cmp(&y.2)));
    let mut warped = 0;
    for (_, node, i) in pulls {
        // A crossing counts only while both its ends are at their lattice positions.
        if sides[cuts[i].inside as usize] != Side::On && sides[cuts[i].outside as usize] != Side::On {
            sides[node as usize] = Side::On;
            positions[node as usize] = cuts[i].point;
            warped += 1;
        }
    }
    warped
}

/// A node on a lattice edge.
struct Crossing {
    edge: Edge,
    node: u32,
    /// Edges are bisected in the order of this key, which decides the diagonals of cut faces.
    key: (bool, f64),
}

/// Splits lattice tets at the crossings of their edges.
struct Splitter<'a> {
    sides: &'a [Side],
    /// Sorted by edge.
    crossings: &'a [Crossing],
}

impl Splitter<'_> {
    /// Appends the inside part of a tet to `out`. Edges are bisected in one global order, so the two tets at
    /// a face split it alike.
    fn inner_part(&self, tet: [u32; 4], out: &mut Vec<[u32; 4]>) {
        let side = |n: u32| self.sides[n as usize];
        if tet.iter().all(|&n| side(n) != Side::Inside) {
            return;
        }
        if tet.iter().all(|&n| side(n) != Side::Outside) {
            out.push(tet);
            return;
        }
        let Some((i, j, node)) = self.first_crossing(&tet) else { return };
        let (mut keeps_i, mut keeps_j) = (tet, tet);
        keeps_i[j] = node;
        keeps_j[i] = node;
        self.inner_part(keeps_i, out);
        self.inner_part(keeps_j, out);
    }

    /// The crossed edge of a tet that is bisected first, as local nodes, and the node of its crossing.
    fn first_crossing(&self, tet: &[u32; 4]) -> Option<(usize, usize, u32)> {
        let mut first: Option<(&Crossing, usize, usize)> = None;
        for i in 0..4 {
            for j in i + 1..4 {
                let edge = Edge::new(tet[i], tet[j]);
                let Ok(at) = self.crossings.binary_search_by_key(&edge, |c| c.edge) else { continue };
                let candidate = &self.crossings[at];
                let earlier = first.is_none_or(|(c, _, _)| candidate.precedes(c));
                if earlier {
                    first = Some((candidate, i, j));
                }
            }
        }
        first.map(|(c, i, j)| (i, j, c.node))
    }
}

impl Crossing {
    fn precedes(&self, other: &Crossing) -> bool {
        let (long, length) = self.key;
        let order =
            long.cmp(&other.key.0).then(length.total_cmp(&other.key.1)).then(self.edge.cmp(&other.edge));
        order.is_lt()
    }
}

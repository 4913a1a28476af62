//! Integrals over the cells: volumes and areas of vertices, quadrature points, loose parts.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::cells::Octree;
use super::change::{Leaf, OctreeChange};
use super::lattice::{At, OUTSIDE};
use super::vertices::{corner_shares, corner_weights};
use crate::cut::Components;
use crate::element::{Point, Points, deformation_gradient, hex8, quadrature};
use crate::material::Region;
use crate::storage::disjoint::{find, join};
use crate::storage::reserve::resize_reserving;

/// Corners of the faces in the directions −x, +x, −y, +y, −z, +z.
pub const FACES: [[usize; 4]; 6] =
    [[0, 2, 4, 6], [1, 3, 5, 7], [0, 1, 4, 5], [2, 3, 6, 7], [0, 1, 2, 3], [4, 5, 6, 7]];

/// Parts of a finest cell that shares of its volume count in: an eighth for each corner, and a quarter of that for
/// the vertices around a corner that hangs inside a face.
const PARTS: f64 = 32.0;

impl Leaf {
    /// Calls `visit` with the vertices that carry the leaf and their shares of its volume, in finest cells: an
    /// eighth for each corner.
    fn for_shares(&self, mut visit: impl FnMut(u32, f64)) {
        let share = f64::from(self.cell.side()).powi(3) / 8.0;
        let shares = corner_shares(&self.cell, self.hanging);
        let carriers = self.vertices.iter().zip(shares).filter(|(_, corners)| *corners != 0.0);
        carriers.for_each(|(&v, corners)| visit(v, corners * share));
    }
}

impl Octree {
    /// Whether the face of leaf `id` in direction `d` is on the boundary of the body.
    pub fn leads_out(&self, id: u32, d: usize) -> bool {
        let cell = &self.cells[id as usize];
        cell.cut >> d & 1 == 1 && self.leaf(Self::across(cell.at, d)) == OUTSIDE
    }

    /// Rest position of every vertex [m].
    pub fn rest_positions(&self) -> Vec<Vector3<f64>> {
        self.points.iter().map(|&p| self.lattice.point(p)).collect()
    }

    /// Rest position of one vertex [m].
    pub fn rest_position(&self, vertex: u32) -> Vector3<f64> {
        self.lattice.point(self.points[vertex as usize])
    }

    /// Volume of a leaf at rest [m³].
    pub fn cell_volume(&self, id: usize) -> f64 {
        (f64::from(self.cells[id].side()) * self.lattice.h).powi(3)
    }

    /// ∫ N_a dV of every vertex [m³].
    pub fn vertex_volumes(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.n_vertices()];
        for id in 0..self.cells.len() as u32 {
            self.now(id).for_shares(|v, share| out[v as usize] += share);
        }
        let finest = self.lattice.h.powi(3);
        out.iter_mut().for_each(|volume| *volume *= finest);
        out
    }

    /// Brings the volumes of vertices up to date after `change`, in time that only depends on its size. They are
    /// those of [`vertex_volumes`](Self::vertex_volumes) to the bit: shares of finest cells are sums of 32nds,
    /// which are exact.
    pub fn follow_volumes(&self, change: &OctreeChange, volumes: &mut Vec<f64>) {
        let finest = self.lattice.h.powi(3);
        resize_reserving(volumes, self.n_vertices(), 0.0);
        let mut add = |v: u32, share: f64| {
            let volume = &mut volumes[v as usize];
            let known = (*volume / finest * PARTS).round() / PARTS;
            *volume = (known + share) * finest;
        };
        change.earlier.iter().for_each(|leaf| leaf.for_shares(|v, share| add(v, -share)));
        change.cells.iter().for_each(|&id| self.now(id).for_shares(&mut add));
    }

    /// Mass of every vertex [kg] in a body of this density.
    pub fn vertex_masses(&self, density_kg_m3: f64) -> Vec<f64> {
        let finest = self.lattice.h.powi(3);
        let mut out = vec![0.0; self.n_vertices()];
        for (id, cell) in (0u32..).zip(&self.cells) {
            let region = Region::numbered(&self.regions, cell.material);
            let density = region.map_or(density_kg_m3, |region| region.density_kg_m3);
            self.now(id).for_shares(|v, share| out[v as usize] += density * finest * share);
        }
        out
    }

    /// ∫ N_a dA [m²] over the boundary faces all of whose vertices are `selected`, by vertex.
    pub fn areas(&self, selected: &[bool]) -> Vec<f64> {
        let mut area = vec![0.0; self.n_vertices()];
        let share = self.lattice.h * self.lattice.h / 4.0;
        for (id, cell) in self.cells.iter().enumerate().filter(|(_, cell)| cell.cut != 0) {
            let W = corner_weights(cell, self.hanging[id]);
            for (d, face) in FACES.iter().enumerate() {
                let carriers = |c: usize| self.vertices[id].into_iter().zip(W[c]).filter(|(_, w)| *w != 0.0);
                let chosen = || face.iter().all(|&c| carriers(c).all(|(v, _)| selected[v as usize]));
                if self.leads_out(id as u32, d) && chosen() {
                    for &c in face {
                        carriers(c).for_each(|(v, w)| area[v as usize] += w * share);
                    }
                }
            }
        }
        area
    }

    /// Whether the vertex with this number is at the same lattice point as `vertex`.
    pub fn vertices_at(&self, vertex: u32) -> Vec<u32> {
        let p = self.points[vertex as usize];
        let octants = self.octants(p);
        let mut found: Vec<u32> = (0..8)
            .filter(|&o| octants.leaf[o] != OUTSIDE)
            .map(|o| (octants.leaf[o] as usize, 7 - o))
            .filter(|&(id, c)| self.cells[id].corner(c) == p && self.hanging[id] >> c & 1 == 0)
            .map(|(id, c)| self.vertices[id][c])
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Loose parts, by leaf, and their volumes [m³].
    pub fn components(&self) -> Components {
        let mut root: Vec<u32> = (0..self.cells.len() as u32).collect();
        self.for_links(|a, b, _| {
            join(&mut root, a, b);
        });
        let mut part_of_root = BTreeMap::new();
        let mut parts = Components { of_piece: Vec::with_capacity(root.len()), volume: Vec::new() };
        for id in 0..root.len() {
            let part = *part_of_root.entry(find(&mut root, id as u32)).or_insert_with(|| {
                parts.volume.push(0.0);
                parts.volume.len() as u32 - 1
            });
            parts.volume[part as usize] += self.cell_volume(id);
            parts.of_piece.push(part);
        }
        parts
    }

    /// The leaf that holds the point `p` [m] at rest, and the point's local coordinates in it, 0 … 1 along each
    /// axis. Outside the body, the nearest leaf within a finest cell's reach, if there is one.
    pub fn locate(&self, p: &Vector3<f64>) -> Option<(u32, [f64; 3])> {
        let at = self.lattice.coordinates(p);
        let own: At = [0, 1, 2].map(|k| at[k].floor() as i32);
        let mut best: Option<(f64, u32)> = None;
        super::build::for_around(own, |near| {
            let leaf = self.leaf(near);
            if leaf != OUTSIDE {
                let beyond =
                    |k: usize| (f64::from(near[k]) - at[k]).max(at[k] - f64::from(near[k] + 1)).max(0.0);
                let distance = (0..3).map(|k| beyond(k).powi(2)).sum::<f64>();
                if best.is_none_or(|(least, _)| distance < least) {
                    best = Some((distance, leaf));
                }
            }
        });
        let (_, leaf) = best?;
        let cell = &self.cells[leaf as usize];
        Some((leaf, [0, 1, 2].map(|k| (at[k] - f64::from(cell.at[k])) / f64::from(cell.side()))))
    }

    /// Box around the leaves at rest, lower and upper corner [m].
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        let none = [[i32::MAX; 3], [i32::MIN; 3]];
        let [low, high] = self.cells.iter().fold(none, |[low, high], cell| {
            let (a, b) = (cell.corner(0), cell.corner(7));
            [[0, 1, 2].map(|k| low[k].min(a[k])), [0, 1, 2].map(|k| high[k].max(b[k]))]
        });
        [self.lattice.point(low), self.lattice.point(high)]
    }

    /// ∫ N_a dV [m³] over a leaf, for each of its eight vertices.
    pub fn shape_integrals(&self, id: usize) -> [f64; 8] {
        let share = self.cell_volume(id) / 8.0;
        corner_shares(&self.cells[id], self.hanging[id]).map(|corners| corners * share)
    }

    /// Vertices and weights (Σ = 1) of the point that rests at `p` [m], as part of the leaf `id`; beyond its
    /// faces the displacement of the leaf is continued.
    pub fn carriers(&self, id: u32, p: &Vector3<f64>) -> Vec<(u32, f64)> {
        let (id, at) = (id as usize, self.lattice.coordinates(p));
        let cell = &self.cells[id];
        let local = [0, 1, 2].map(|k| (at[k] - f64::from(cell.at[k])) / f64::from(cell.side()));
        let W = corner_weights(cell, self.hanging[id]);
        let mut weights = [0.0; 8];
        for (c, row) in W.iter().enumerate() {
            let N: f64 = (0..3).map(|k| if c >> k & 1 == 1 { local[k] } else { 1.0 - local[k] }).product();
            weights.iter_mut().zip(row).for_each(|(weight, w)| *weight += N * w);
        }
        self.vertices[id].into_iter().zip(weights).collect()
    }

    /// The leaf that the material at `p` [m] belongs to, of `id`, which covers it, and the neighbours from which
    /// cuts separate that one: a cut may pass between `p` and the centre of `id`.
    pub fn on_side_of_cuts(&self, id: u32, p: &Vector3<f64>) -> u32 {
        let cell = &self.cells[id as usize];
        let centre = self.lattice.centre(cell.at);
        for d in (0..6).filter(|d| cell.cut >> d & 1 == 1) {
            let (axis, up) = (d / 2, d % 2 == 1);
            let across = Self::across(cell.at, d);
            let lower = if up { cell.at } else { across };
            let Some(link) = self.links.get(&(lower, axis as u8)) else { continue };
            let end = usize::from(!up);
            let mut on_cut = self.lattice.centre(lower);
            on_cut[axis] += link.at[end] * self.lattice.h;
            let height = |q: &Vector3<f64>| link.normal[end].dot(&(q - on_cut));
            if height(p) * height(&centre) < 0.0 && self.leaf(across) != OUTSIDE {
                return self.leaf(across);
            }
        }
        id
    }
}

/// Gradients of the shape functions at the quadrature points of [−1, 1]³.
fn reference_gradients() -> [[Vector3<f64>; 8]; 8] {
    quadrature::cube_gauss_2().map(|xi| hex8::reference_gradients(&xi))
}

impl Octree {
    /// Calls `visit` for the quadrature points of a leaf.
    fn for_points_of(
        &self,
        (element, leaf): (usize, &Leaf),
        reference: &[[Vector3<f64>; 8]],
        x: &[Vector3<f64>],
        visit: &mut dyn FnMut(Point<'_>),
    ) {
        let Leaf { cell, vertices: nodes, hanging } = leaf;
        let side = f64::from(cell.side()) * self.lattice.h;
        // On [−1, 1]³; a side of s gives 2/s.
        let (per_metre, weight) = (2.0 / side, side.powi(3) / 8.0);
        let W = (*hanging != 0).then(|| corner_weights(cell, *hanging));
        let at = nodes.map(|v| x[v as usize]);
        for of_corners in reference {
            let mut gradients = of_corners.map(|g| g * per_metre);
            if let Some(W) = &W {
                let corners = std::mem::replace(&mut gradients, [Vector3::zeros(); 8]);
                for (row, g) in W.iter().zip(corners) {
                    gradients.iter_mut().zip(row).for_each(|(out, w)| *out += *w * g);
                }
            }
            let F: Matrix3<f64> = deformation_gradient(&at, &gradients);
            visit(Point { element, nodes, gradients: &gradients, weight, F, region: cell.material });
        }
    }

    /// Some leaves, now or before a change.
    pub fn some(&self, leaves: Vec<Leaf>) -> Leaves<'_> {
        Leaves { octree: self, leaves }
    }
}

impl Points for Octree {
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        let reference = reference_gradients();
        for id in 0..self.cells.len() {
            self.for_points_of((id, &self.now(id as u32)), &reference, x, visit);
        }
    }

    fn regions(&self) -> &[Region] {
        &self.regions
    }
}

/// Some leaves of an octree, numbered from 0.
#[derive(Clone, Debug)]
pub struct Leaves<'a> {
    octree: &'a Octree,
    leaves: Vec<Leaf>,
}

impl Points for Leaves<'_> {
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        let reference = reference_gradients();
        for leaf in self.leaves.iter().enumerate() {
            self.octree.for_points_of(leaf, &reference, x, visit);
        }
    }

    fn regions(&self) -> &[Region] {
        &self.octree.regions
    }
}

//! The wound: lip faces of the fragments as triangles whose borders follow the skin.

use super::base::Base;
use super::misfit::Misfit;
use super::sheet::Sheet;
use crate::cut::CutMesh;
use crate::cut::topology::fragments::NONE;
use crate::mesh::TET_FACES;

/// A fragment face: the fragment, and the slot of the vertex opposite.
pub(super) type Face = (u32, u8);

/// The origin of a corner of a surface triangle.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) enum Corner {
    /// A skin point.
    Skin(u32),
    /// A fragment vertex.
    Lip(u32),
    /// The middle of a lip.
    Middle,
}

/// One edge of the cut curve: where a lip meets the boundary of the uncut mesh.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Border {
    /// Fragment below the skin next to the border.
    pub below: u32,
    /// Boundary face below the border.
    pub face: u32,
    /// Skin points at its ends.
    pub ends: [u32; 2],
    /// Skin half-edges along it. The skin on this side of the cut is to their left.
    pub chain: Vec<u32>,
}

/// The triangles of one lip face.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Lip {
    /// Numbers of its surface triangles.
    pub triangles: Vec<u32>,
    /// Per edge where it meets the skin, if it does.
    pub borders: [Option<Border>; 3],
    /// Surface half-edges along each of its edges, in the direction of the edge.
    pub outline: [Vec<u32>; 3],
}

/// Whether a fragment face is a lip.
pub(super) fn is_lip(cut: &CutMesh, (t, k): Face) -> bool {
    let f = &cut.fragments;
    f.neighbour[t as usize][k as usize] == NONE && f.tag[t as usize][k as usize] != 0
}

impl Lip {
    /// Finds where a lip meets the skin, and inserts the ends of those edges as skin points.
    pub(super) fn new(base: &Base, cut: &CutMesh, sheet: &mut Sheet, snapping: f64, (t, k): Face) -> Self {
        let f = &cut.fragments;
        let mut lip = Self::default();
        for (edge, border) in lip.borders.iter_mut().enumerate() {
            let (below, slot, along) = f.around_edge(t, k as usize, edge);
            if f.tag[below as usize][slot] != 0 {
                continue;
            }
            *border = base.under(cut.mesh(), f, below, slot).map(|face| {
                let corners = [along, (along + 1) % 3].map(|c| f.tets[below as usize][TET_FACES[slot][c]]);
                let ends = corners.map(|v| sheet.insert_point(base, face, &f.vertices[v as usize], snapping));
                Border { below, face, ends, chain: Vec::new() }
            });
        }
        lip
    }

    /// Cuts the skin along the borders of the lip.
    pub(super) fn cut(&self, base: &Base, sheet: &mut Sheet, snapping: f64) {
        for border in self.borders.iter().flatten() {
            sheet.cut_along(base, border.face, border.ends[0], border.ends[1], snapping);
        }
    }

    /// Finds the skin half-edges along the borders.
    pub(super) fn find_chains(&mut self, sheet: &Sheet) -> Result<(), Misfit> {
        for border in self.borders.iter_mut().flatten() {
            let [from, to] = border.ends;
            let path = sheet.cut_between(border.face, from, to).unwrap_or_default();
            let half_edges = path.windows(2).map(|e| sheet.half_edge(border.face, e[0], e[1]));
            border.chain = half_edges.collect::<Option<Vec<u32>>>().unwrap_or_default();
            if border.chain.is_empty() {
                return Err(Misfit::NoChain);
            }
        }
        Ok(())
    }

    /// Corners around the lip, and the number of parts of each of its edges.
    pub(super) fn ring(&self, cut: &CutMesh, sheet: &Sheet, (t, k): Face) -> (Vec<Corner>, [usize; 3]) {
        let mut ring = Vec::with_capacity(6);
        let mut parts = [1; 3];
        for (edge, border) in self.borders.iter().enumerate() {
            match border {
                Some(border) => {
                    // The border of a lip runs opposite to the skin.
                    ring.extend(border.chain.iter().rev().map(|&h| Corner::Skin(sheet.to(h))));
                    parts[edge] = border.chain.len();
                }
                None => {
                    let corner = TET_FACES[k as usize][edge];
                    ring.push(Corner::Lip(cut.fragments.tets[t as usize][corner]));
                }
            }
        }
        (ring, parts)
    }
}

/// Triangles that fill an outline whose three sides have `parts` parts. Corners are indices into the ring;
/// `n`, the length of the ring, stands for the middle. Both lips of a cut are filled alike.
pub(super) fn fill(n: usize, parts: [usize; 3]) -> Vec<[usize; 3]> {
    if n == 3 {
        return vec![[0, 1, 2]];
    }
    if parts.iter().filter(|&&p| p > 1).count() == 1 {
        // A fan from the corner opposite the divided side.
        let side = parts.iter().position(|&p| p > 1).unwrap_or(0);
        let first: usize = parts[..side].iter().sum();
        let apex = (first + parts[side] + 1) % n;
        return (0..parts[side]).map(|i| [(first + i) % n, (first + i + 1) % n, apex]).collect();
    }
    (0..n).map(|i| [i, (i + 1) % n, n]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_of_an_outline_has_one_triangle_and_every_edge_inside_two() {
        for parts in [[1, 1, 1], [4, 1, 1], [1, 3, 1], [1, 1, 2], [2, 2, 1], [3, 1, 5], [2, 2, 2]] {
            let n: usize = parts.iter().sum();
            let mut edges: Vec<[usize; 2]> =
                fill(n, parts).iter().flat_map(|t| [0, 1, 2].map(|k| [t[k], t[(k + 1) % 3]])).collect();
            edges.sort_unstable();
            let count = edges.len();
            edges.dedup();
            assert_eq!(edges.len(), count, "{parts:?}");
            let outline = |e: &[usize; 2]| e[0] < n && e[1] == (e[0] + 1) % n;
            assert_eq!(edges.iter().filter(|e| outline(e)).count(), n, "{parts:?}");
            let inner = edges.iter().filter(|e| !outline(e));
            assert!(inner.clone().all(|&[a, b]| edges.contains(&[b, a])), "{parts:?}");
        }
    }
}

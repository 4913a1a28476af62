//! Strips: three tets in a row, each of which shares a face with the one before.
//!
//! A strip has six copies where three tets alone have twelve. Most of the time of an application goes into reading and
//! adding up rows of copies, so tets in strips take two thirds of it.

use scindo_matter::element::LANES;

/// Tets of a strip.
pub(super) const TETS: usize = 3;
/// Copies of a strip.
pub(super) const NODES: usize = TETS + 3;

/// Numbers of the corners of a tet in the order in which a lane has them.
pub(super) type Corners = [u8; 4];

/// Corners in the order of the mesh.
pub(super) const AS_IN_MESH: Corners = [0, 1, 2, 3];

/// Order of the corners of one lane, given those of the batches that are strips. These come first; in all others it is
/// that of the mesh.
pub(super) fn corners_of(strips: &[[Corners; LANES]], batch: usize, lane: usize) -> Corners {
    strips.get(batch).map_or(AS_IN_MESH, |lanes| lanes[lane])
}

/// No tet.
const NONE: u32 = u32::MAX;

/// Three tets; tet t has the corners `nodes[t]` … `nodes[t + 3]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Strip {
    /// Numbers of the tets.
    pub tets: [u32; TETS],
    /// Local numbers of its copies.
    pub nodes: [u16; NODES],
}

impl Strip {
    /// Corners of tet number `t` of the strip, whose copies are `held`, in the order that it has in the strip.
    pub(super) fn corners(&self, t: usize, held: &[u16; 4]) -> Corners {
        let corner = |node: u16| held.iter().position(|&other| other == node).unwrap_or(0) as u8;
        [0, 1, 2, 3].map(|k| corner(self.nodes[t + k]))
    }
}

/// Tets across the four faces of every tet; face c is opposite corner c.
struct Neighbours(Vec<[u32; 4]>);

impl Neighbours {
    fn new(tets: &[[u16; 4]]) -> Self {
        let mut faces: Vec<(u64, u32)> = Vec::with_capacity(4 * tets.len());
        for (t, tet) in (0_u32..).zip(tets) {
            for c in 0..4 {
                let mut face = [1, 2, 3].map(|k| tet[(c + k) % 4]);
                face.sort_unstable();
                let key = face.iter().fold(0, |key, &node| key << 16 | u64::from(node));
                faces.push((key, 4 * t + c as u32));
            }
        }
        faces.sort_unstable();
        let mut across = vec![[NONE; 4]; tets.len()];
        for same in faces.chunk_by(|a, b| a.0 == b.0) {
            // After cuts, more than two pieces may have three copies in common; two of them are neighbours.
            if let [(_, a), (_, b), ..] = *same {
                across[a as usize / 4][a as usize % 4] = b / 4;
                across[b as usize / 4][b as usize % 4] = a / 4;
            }
        }
        Self(across)
    }

    /// Corners of tet `t` across from which there is a tet that is not in use.
    fn free(&self, t: u32, used: &[bool]) -> impl Iterator<Item = (usize, u32)> {
        let across = self.0[t as usize].into_iter().enumerate();
        across.filter(|&(_, other)| other != NONE && !used[other as usize])
    }
}

/// Joins tets, each with four different copies, to strips, greedily: those first that have few free neighbours left.
/// The tets that are in none are left over.
pub(super) fn find_strips(tets: &[[u16; 4]]) -> Vec<Strip> {
    let neighbours = Neighbours::new(tets);
    let mut used = vec![false; tets.len()];
    let mut strips = Vec::with_capacity(tets.len() / TETS);
    for first in 0..tets.len() as u32 {
        if used[first as usize] {
            continue;
        }
        // As its end, or as its middle; ends that others need least come first.
        let free = |t: u32| neighbours.free(t, &used).count();
        let mut best: Option<(usize, [u32; TETS])> = None;
        let mut offer = |strip: [u32; TETS]| {
            let cost = strip.iter().map(|&t| free(t)).sum();
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, strip));
            }
        };
        for (_, middle) in neighbours.free(first, &used) {
            for (_, last) in neighbours.free(middle, &used).filter(|(_, last)| *last != first) {
                offer([first, middle, last]);
            }
            for (_, other) in neighbours.free(first, &used).filter(|(_, other)| *other > middle) {
                offer([middle, first, other]);
            }
        }
        let Some((_, strip)) = best else { continue };
        if let Some(nodes) = in_order(strip.map(|t| &tets[t as usize])) {
            strip.iter().for_each(|&t| used[t as usize] = true);
            strips.push(Strip { tets: strip, nodes });
        }
    }
    strips
}

/// The copies of three tets of which each shares a face with the next, so that each tet has four in a row.
fn in_order([first, middle, last]: [&[u16; 4]; TETS]) -> Option<[u16; NODES]> {
    let only = |of: &[u16; 4], other: &[u16; 4]| {
        let mut alone = of.iter().filter(|node| !other.contains(node));
        alone.next().copied().filter(|_| alone.next().is_none())
    };
    let (start, end) = (only(first, middle)?, only(last, middle)?);
    let (second, fifth) = (only(middle, last)?, only(middle, first)?);
    let mut inner = middle.iter().copied().filter(|&node| node != second && node != fifth);
    let (third, fourth) = (inner.next()?, inner.next()?);
    (inner.next().is_none()).then_some([start, second, third, fourth, fifth, end])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use scindo_matter::mesh::{BoxPattern, box_mesh};

    #[test]
    fn most_tets_of_a_block_are_in_strips() {
        for pattern in [BoxPattern::Tet5 { parity: false }, BoxPattern::Tet6] {
            let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [6, 5, 6], pattern);
            let tets: Vec<[u16; 4]> = mesh.tets.iter().map(|tet| tet.map(|n| n as u16)).collect();
            let strips = find_strips(&tets);
            let mut seen = vec![0; tets.len()];
            for strip in &strips {
                for (t, &tet) in strip.tets.iter().enumerate() {
                    seen[tet as usize] += 1;
                    let held = &tets[tet as usize];
                    let corners = strip.corners(t, held).map(usize::from);
                    assert_eq!(corners.map(|c| held[c])[..], strip.nodes[t..t + 4]);
                    assert_eq!(corners.iter().sum::<usize>(), 6);
                }
            }
            assert!(seen.iter().all(|&n| n <= 1));
            let share = (TETS * strips.len()) as f64 / tets.len() as f64;
            assert!(share > 0.93, "{pattern:?}: {share}");
        }
    }

    #[test]
    fn pieces_around_one_face_make_no_strip() {
        // Three pieces share one face, so that no two of its neighbours lie in a row.
        assert_eq!(find_strips(&[[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]]), []);
        assert_eq!(in_order([&[0, 1, 2, 3], &[0, 1, 2, 4], &[0, 1, 2, 5]]), None);
        let strips = find_strips(&[[0, 1, 2, 3], [4, 2, 1, 3], [5, 4, 3, 2]]);
        assert_eq!(strips, [Strip { tets: [0, 1, 2], nodes: [0, 1, 2, 3, 4, 5] }]);
    }
}

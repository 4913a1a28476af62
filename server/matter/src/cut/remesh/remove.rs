//! Removal: the elements that the sweep touches are taken out, with their mass. It is the simplest way to cut, and a
//! baseline that other ways are measured against.
//!
//! # Source
//! Cotin, Delingette, Ayache 2000, *A hybrid elastic model for real-time cutting, deformations, and force feedback for
//! surgery training and simulation*.

use std::collections::BTreeSet;

use super::complex::{Complex, face_key};
use super::memory::Memory;

/// What the removal left.
#[derive(Clone, Debug, Default)]
pub struct Removed {
    /// Number of elements taken out.
    pub elements: usize,
    /// Nodes of the elements that were taken out, as far as others use them.
    pub nodes: BTreeSet<u32>,
}

/// Takes out all elements with an edge that the sweep of `crossed` crosses, and marks the faces that they leave open as
/// lips of `incision`. The last element stays.
pub fn remove(complex: &mut Complex, crossed: &Memory, incision: u32, n_elements: usize) -> Removed {
    let edges = crossed.crossings.keys();
    let wanted: BTreeSet<u32> = edges.flat_map(|edge| complex.around_edge(edge[0], edge[1])).collect();
    let mut removed = Removed::default();
    for t in wanted {
        if removed.elements + 1 >= n_elements {
            break;
        }
        removed.nodes.extend(complex.tet(t));
        let sides = [0, 1, 2, 3].map(|k| (face_key(complex.face(t, k)), complex.neighbour(t, k)));
        complex.remove_tet(t);
        removed.elements += 1;
        for (key, neighbour) in sides {
            let tag = neighbour.map(|_| incision);
            // A face that has lost both of its elements is no lip.
            if tag.is_some() || complex.tag(&key).is_some() {
                complex.set_tag(key, tag);
            }
        }
    }
    removed.nodes.retain(|&n| !complex.around(n).is_empty());
    removed
}

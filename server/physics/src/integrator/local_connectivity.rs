//! Connected parts of a body after a cut, found from the neighbourhood of the cut.
//!
//! Most cuts are incisions: the two lips are joined around their front. The pieces that the cut changed
//! then show that the parts of the body are still those from before. Only if they do not show it is the
//! whole body searched.

use scindo_matter::cut::NewCopy;
use scindo_matter::element::FixedCopy;
use scindo_matter::storage::disjoint::{find, join};
use scindo_matter::storage::numbering::Numbering;
use scindo_matter::storage::reserve::resize_reserving;

use super::parts::LooseParts;
use crate::space::Space;

/// Buffers of the local search.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct LocalConnectivity {
    numbering: Numbering,
    /// Copies on the changed pieces, and on the elements around copies that others were split from.
    copies: Vec<u32>,
    /// Union–find: for each of these copies another one that it is connected to, up to a root.
    root: Vec<u32>,
}

impl LocalConnectivity {
    /// Reserves memory for cuts through a body of `n_copies` copies.
    pub fn with_capacity(n_copies: usize) -> Self {
        Self { numbering: Numbering::with_capacity(n_copies), ..Self::default() }
    }

    /// Brings `parts` up to date after a cut, the last one of `space`, that made the copies `new`.
    /// `mass` [kg] and `fixed` are those after it. The result is that of [`LooseParts::connected`]. Returns whether the
    /// parts are those from before.
    pub fn follow(
        &mut self,
        parts: &mut LooseParts,
        space: &dyn Space,
        new: &[NewCopy],
        mass: &[f64],
        fixed: &[FixedCopy],
    ) -> bool {
        resize_reserving(&mut parts.of_copy, mass.len(), 0);
        for new in new {
            parts.of_copy[new.copy as usize] = parts.of_copy[new.parent as usize];
        }
        let holds = self.holds(parts, space, new);
        if holds {
            parts.measure(mass, fixed);
        } else {
            *parts = LooseParts::connected(|visit| space.for_groups(visit), mass, fixed);
        }
        holds
    }

    /// Whether, in every part, the changed pieces connect all copies that the cut changed. No part has
    /// then come apart. A lost connection ran through a changed piece, so each side of it has a copy of
    /// that piece, or the copy that one was split from. These copies are still connected, and so are both
    /// sides.
    fn holds(&mut self, parts: &LooseParts, space: &dyn Space, new: &[NewCopy]) -> bool {
        self.copies.clear();
        self.root.clear();
        space.for_changed_groups(&mut |group| self.join(group));
        let known = |parent: &u32| self.numbering.find(&self.copies, *parent).is_some();
        let lone: Vec<u32> = new.iter().map(|new| new.parent).filter(|parent| !known(parent)).collect();
        for copy in lone {
            space.for_groups_around(copy, &mut |group| self.join(group));
        }
        let mut root_of_part = vec![u32::MAX; parts.len()];
        (0..self.copies.len()).all(|i| {
            let root = find(&mut self.root, i as u32);
            let of_part = &mut root_of_part[parts.of_copy[self.copies[i] as usize] as usize];
            if *of_part == u32::MAX {
                *of_part = root;
            }
            *of_part == root
        })
    }

    fn join(&mut self, copies: &[u32]) {
        let mut first = None;
        for &copy in copies {
            let at = if self.numbering.insert(&mut self.copies, copy) {
                self.root.push(self.root.len() as u32);
                self.root.len() as u32 - 1
            } else {
                self.numbering.find(&self.copies, copy).map_or(0, |at| at as u32)
            };
            join(&mut self.root, *first.get_or_insert(at), at);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::space::Tets;
    use scindo_matter::cut::{BladeSweep, CutMesh};
    use scindo_matter::element::Held;
    use scindo_matter::mesh::{BoxPattern, box_mesh};
    use scindo_matter::team::Team;

    #[test]
    fn parts_that_follow_cuts_are_those_of_the_whole_body() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::new(6.0, 4.0, 4.0), [6, 4, 4], BoxPattern::Tet6);
        let mut cut = Tets::linear(CutMesh::new(mesh).unwrap());
        let held: Vec<u32> = (0..cut.n_copies() as u32).filter(|c| c % 35 == 3).collect();
        let hold = |&copy: &u32| FixedCopy { copy, held: Held::FULLY, position_m: [0.0; 3] };
        let fixed: Vec<FixedCopy> = held.iter().map(hold).collect();
        let mut parts = LooseParts::connected(|visit| cut.for_groups(visit), cut.copy_volumes(), &fixed);
        let mut connectivity = LocalConnectivity::default();
        // Incisions and cuts right through, across elements and (the whole numbers) along their faces.
        let places = [(2.3, 3.1), (1.0, 2.5), (2.3, 4.5), (1.0, 4.5), (3.0, 4.5), (3.0, 1.5), (0.4, 4.5)];
        let mut sizes = Vec::new();
        for ((x, depth), incision) in places.into_iter().zip(1..) {
            let at = |y: f64| [Vector3::new(x, y, -0.5), Vector3::new(x, y, 4.5)];
            let sweep = BladeSweep { segments: vec![at(-0.5), at(depth)] };
            let report = cut.cut(&mut Team::alone(), &cut.rest_positions(), &sweep, incision).unwrap();
            let mass = cut.copy_volumes();
            connectivity.follow(&mut parts, &cut, &report.new_copies, mass, &fixed);
            let whole = LooseParts::connected(|visit| cut.for_groups(visit), mass, &fixed);
            assert_eq!(parts, whole, "incision {incision}");
            sizes.push(parts.len());
            // A body that stays connected is recognised near the cut.
            assert!(parts.len() > 1 || connectivity.holds(&parts, &cut, &report.new_copies));
        }
        assert_eq!(sizes, [1, 1, 2, 3, 4, 4, 5]);
    }
}

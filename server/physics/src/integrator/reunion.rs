//! Whether what a cut touched still hangs together close to the cut.
//!
//! Most cuts are incisions: around their front the two lips are one. To see that, no more has to be
//! looked at than what the cut changed, and then the parts of the body are those it had. Only where
//! that does not tell is the whole body looked at.

use super::parts::LooseParts;
use crate::cut::{CutMesh, NewCopy};
use crate::numbering::Numbering;
use crate::operator::{FixedCopy, resize_with_room};

/// Scratch of a look at what a cut changed.
#[derive(Clone, Debug, Default)]
pub struct Reunion {
    numbering: Numbering,
    /// Copies on the changed pieces, and of what others were split from.
    copies: Vec<u32>,
    /// For each of them one that it hangs together with, up to a root.
    root: Vec<u32>,
}

impl Reunion {
    /// Brings `parts` up to date after a cut, the last one of `mesh`, that made the copies `new`.
    /// `mass` [kg] and `fixed` are those after it. The result is that of [`LooseParts::new`].
    pub fn follow(
        &mut self,
        parts: &mut LooseParts,
        mesh: &CutMesh,
        new: &[NewCopy],
        mass: &[f64],
        fixed: &[FixedCopy],
    ) {
        resize_with_room(&mut parts.of_copy, mass.len(), 0);
        for new in new {
            parts.of_copy[new.copy as usize] = parts.of_copy[new.parent as usize];
        }
        if self.holds(parts, mesh, new) {
            parts.measure(mass, fixed);
        } else {
            *parts = LooseParts::new(mesh.pieces(), mass, fixed);
        }
    }

    /// Whether of every part all that the cut changed hangs together by the changed pieces. A part can
    /// only come apart into pieces of which each has one of these copies: a link that is gone was at a
    /// changed piece, and had a copy that the piece still has or that its present one was split from.
    fn holds(&mut self, parts: &LooseParts, mesh: &CutMesh, new: &[NewCopy]) -> bool {
        self.copies.clear();
        self.root.clear();
        for &p in mesh.changed_pieces() {
            self.join(mesh.pieces()[p as usize].copies);
        }
        for new in new {
            if self.numbering.find(&self.copies, new.parent).is_none() {
                mesh.tets_around(new.parent).into_iter().for_each(|copies| self.join(copies));
            }
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

    fn join(&mut self, copies: [u32; 4]) {
        let [first, others @ ..] = copies.map(|copy| {
            if self.numbering.insert(&mut self.copies, copy) {
                self.root.push(self.root.len() as u32);
                self.root.len() as u32 - 1
            } else {
                self.numbering.find(&self.copies, copy).map_or(0, |at| at as u32)
            }
        });
        let mut a = find(&mut self.root, first);
        for other in others {
            let b = find(&mut self.root, other);
            self.root[a.max(b) as usize] = a.min(b);
            a = a.min(b);
        }
    }
}

/// The root of `a`; the way there becomes shorter.
pub fn find(root: &mut [u32], mut a: u32) -> u32 {
    while root[a as usize] != a {
        root[a as usize] = root[root[a as usize] as usize];
        a = root[a as usize];
    }
    a
}

//! Lanes shared by pieces that deform as one.
//!
//! An incision that ends inside an element may divide it into pieces that still have all four copies in
//! common. They have the same deformation gradient, so one lane integrates them, with the sum of their
//! fractions. The cost of a stab in a step follows from the copies it makes and not from the pieces.

use scindo_matter::cut::Piece;
use scindo_matter::storage::numbering::Numbering;

use super::chunks::NO_PIECE;

/// Assignment of pieces to lanes. The *carrier* of a piece is the piece whose lane integrates it.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct SharedLanes {
    /// For every piece its carrier: the first piece of its element with the same copies.
    of_piece: Vec<u32>,
    /// For every piece what its lane integrates, if it has one.
    merged: Vec<Merged>,
    /// First piece of every element, and the next piece of the same element of every piece, in order.
    first_in_element: Vec<u32>,
    next_in_element: Vec<u32>,
    members: Vec<u32>,
    /// Elements with a changed piece.
    elements: Vec<u32>,
    numbering: Numbering,
}

/// The pieces of one lane, merged into one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Merged {
    /// The carrier, with the sum of the fractions.
    pub piece: Piece,
    /// Number of pieces merged.
    pub count: u32,
}

/// Changes of the lanes by a cut.
#[derive(Debug, Default)]
pub(super) struct LaneChanges {
    /// Carriers that were carriers before and have other copies or other pieces now.
    pub amended: Vec<u32>,
    /// New carriers, ascending, and the carrier that had their material before ([`NO_PIECE`] if none).
    pub added: Vec<[u32; 2]>,
}

impl SharedLanes {
    /// Finds the carriers among the `pieces` of `n_elements` elements.
    pub(super) fn new(n_elements: usize, pieces: &[Piece]) -> Self {
        let mut carriers = Self { first_in_element: vec![NO_PIECE; n_elements], ..Self::default() };
        let all: Vec<u32> = (0..pieces.len() as u32).collect();
        carriers.follow(pieces, &all);
        carriers
    }

    /// Follows a cut; the `changed` pieces (ascending) are new or have other copies or another fraction.
    /// Cuts only ever take copies apart, so a carrier stays one.
    pub(super) fn follow(&mut self, pieces: &[Piece], changed: &[u32]) -> LaneChanges {
        let known = self.of_piece.len();
        for p in known as u32..pieces.len() as u32 {
            self.append(p, pieces[p as usize].element);
        }
        let mut changes = LaneChanges::default();
        self.elements.clear();
        for &p in changed {
            let element = pieces[p as usize].element;
            if self.numbering.insert(&mut self.elements, element) {
                // New pieces come from earlier ones of the same element, which have changed too.
                let source = if (p as usize) < known { self.of_piece[p as usize] } else { NO_PIECE };
                self.regroup(element, source, known, pieces, &mut changes);
            }
        }
        changes.added.sort_unstable();
        changes
    }

    fn append(&mut self, p: u32, element: u32) {
        self.of_piece.push(p);
        self.next_in_element.push(NO_PIECE);
        let none = Piece { element, fraction: 0.0, copies: [NO_PIECE; 4] };
        self.merged.push(Merged { piece: none, count: 0 });
        let mut last = self.first_in_element[element as usize];
        if last == NO_PIECE {
            self.first_in_element[element as usize] = p;
            return;
        }
        while self.next_in_element[last as usize] != NO_PIECE {
            last = self.next_in_element[last as usize];
        }
        self.next_in_element[last as usize] = p;
    }

    /// Finds the carriers of one element; pieces from `known` on are new and come from `source`.
    fn regroup(
        &mut self,
        element: u32,
        source: u32,
        known: usize,
        pieces: &[Piece],
        changes: &mut LaneChanges,
    ) {
        let mut members = std::mem::take(&mut self.members);
        members.clear();
        let mut p = self.first_in_element[element as usize];
        while p != NO_PIECE {
            members.push(p);
            p = self.next_in_element[p as usize];
        }
        for (i, &p) in members.iter().enumerate() {
            let same = |&&q: &&u32| pieces[q as usize].copies == pieces[p as usize].copies;
            let carrier = members[..i].iter().find(same).copied().unwrap_or(p);
            let before = if (p as usize) < known { self.of_piece[p as usize] } else { source };
            debug_assert!(before != p || carrier == p, "a cut joins no copies");
            self.of_piece[p as usize] = carrier;
            if carrier != p {
                continue;
            }
            // No earlier piece has these copies, so this one carries all later ones that do.
            let of_lane = members[i..].iter().map(|&q| &pieces[q as usize]);
            let of_lane = of_lane.filter(|piece| piece.copies == pieces[p as usize].copies);
            let mut merged = Merged { piece: Piece { fraction: 0.0, ..pieces[p as usize] }, count: 0 };
            for piece in of_lane {
                merged.piece.fraction += piece.fraction;
                merged.count += 1;
            }
            let old = std::mem::replace(&mut self.merged[p as usize], merged);
            if before != p {
                changes.added.push([p, before]);
            } else if old != merged {
                changes.amended.push(p);
            }
        }
        self.members = members;
    }

    /// The carrier of every piece.
    pub(super) fn of_piece(&self) -> &[u32] {
        &self.of_piece
    }

    /// For every piece what its lane integrates; count 0 if it has no lane.
    pub(super) fn merged(&self) -> &[Merged] {
        &self.merged
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(element: u32, fraction: f64, copies: [u32; 4]) -> Piece {
        Piece { element, fraction, copies }
    }

    #[test]
    fn pieces_with_the_same_copies_go_together_until_a_cut_separates_them() {
        let whole = [piece(0, 1.0, [0, 1, 2, 3]), piece(1, 1.0, [1, 2, 3, 4])];
        let mut carriers = SharedLanes::new(2, &whole);
        assert_eq!(carriers.of_piece(), [0, 1]);
        // A stab: three pieces of element 0, all with its nodes.
        let mut pieces = whole.to_vec();
        pieces[0].fraction = 0.5;
        pieces.extend([piece(0, 0.25, [0, 1, 2, 3]), piece(0, 0.25, [0, 1, 2, 3])]);
        let changes = carriers.follow(&pieces, &[0, 2, 3]);
        assert_eq!(carriers.of_piece(), [0, 1, 0, 0]);
        assert!(changes.added.is_empty());
        assert_eq!(carriers.merged()[0], Merged { piece: whole[0], count: 3 });
        // It goes on: pieces 2 and 3 have other copies, and piece 4 came off one of them.
        pieces[2].copies = [0, 5, 2, 3];
        pieces[3] = piece(0, 0.125, [0, 5, 2, 3]);
        pieces.push(piece(0, 0.125, [0, 5, 6, 3]));
        let changes = carriers.follow(&pieces, &[2, 3, 4]);
        assert_eq!(carriers.of_piece(), [0, 1, 2, 2, 4]);
        assert_eq!((changes.amended, changes.added), (vec![0], vec![[2, 0], [4, 0]]));
        assert_eq!(carriers.merged()[0], Merged { piece: pieces[0], count: 1 });
        assert_eq!(carriers.merged()[2].piece.fraction, 0.375);
        assert_eq!((carriers.merged()[3].count, carriers.merged()[4].count), (0, 1));
    }
}

//! Loose parts: connected components of the pieces of a body.

use super::fragments::{Fragments, NONE};
use super::pieces::PieceTable;

/// Loose parts: connected components of the pieces. Part 0 contains piece 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Components {
    /// Part of each piece, length n_pieces.
    pub of_piece: Vec<u32>,
    /// Rest volume [m³] of each part.
    pub volume: Vec<f64>,
}

impl Components {
    /// Number of loose parts.
    pub fn len(&self) -> usize {
        self.volume.len()
    }

    /// Whether there is no part at all. A checked mesh always has one.
    pub fn is_empty(&self) -> bool {
        self.volume.is_empty()
    }

    pub(in crate::cut) fn of(fragments: &Fragments, pieces: &PieceTable) -> Self {
        let n = pieces.pieces.len();
        let mut parts = Self { of_piece: vec![NONE; n], volume: Vec::new() };
        let mut stack = Vec::new();
        for seed in 0..n {
            if parts.of_piece[seed] != NONE {
                continue;
            }
            let part = parts.volume.len() as u32;
            parts.of_piece[seed] = part;
            stack.push(seed as u32);
            let mut volume = 0.0;
            while let Some(p) = stack.pop() {
                volume += pieces.volume(p as usize);
                for t in pieces.fragments(p, fragments) {
                    for n in fragments.neighbour[t as usize] {
                        if n == NONE {
                            continue;
                        }
                        let q = fragments.piece[n as usize];
                        if parts.of_piece[q as usize] == NONE {
                            parts.of_piece[q as usize] = part;
                            stack.push(q);
                        }
                    }
                }
            }
            parts.volume.push(volume);
        }
        parts
    }
}

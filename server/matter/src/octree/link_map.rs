//! A map from links to where they are cut.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use nalgebra::Vector3;

use super::lattice::At;

/// Where a link is cut. Fractions count from the lower end, which is the centre of the lower cell.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CutLink {
    /// Fraction of the way from the lower to the upper centre of the cut nearest to the lower one, and of
    /// that nearest to the upper one.
    pub at: [f64; 2],
    /// Unit normals of the blade, or of the boundary, there, at rest.
    pub normal: [Vector3<f64>; 2],
    /// The incision; 0 is the boundary of the body.
    pub incision: u32,
}

/// A link: its lower cell and its axis.
pub type LinkKey = (At, u8);

/// Where links are cut. Building a surface asks for every link that a cut crosses, so the hash is a fast one.
pub type LinkMap = HashMap<LinkKey, CutLink, BuildHasherDefault<LinkHasher>>;

/// Hashes a few small integers: multiplications by an odd number spread neighbouring ones.
#[derive(Clone, Copy, Debug, Default)]
pub struct LinkHasher(u64);

/// 2⁶⁴ divided by the golden ratio.
const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

impl Hasher for LinkHasher {
    fn write(&mut self, bytes: &[u8]) {
        for part in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..part.len()].copy_from_slice(part);
            self.0 = (self.0.rotate_left(5) ^ u64::from_ne_bytes(word)).wrapping_mul(FACTOR);
        }
    }

    /// Tables use the lowest and the highest bits, and products vary most in the bits below the highest.
    fn finish(&self) -> u64 {
        (self.0 ^ self.0 >> 32).wrapping_mul(FACTOR).rotate_left(26)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::hash::BuildHasher as _;

    use super::*;

    #[test]
    fn links_of_a_block_have_different_hashes() {
        let hasher = BuildHasherDefault::<LinkHasher>::default();
        let n = 32;
        let (mut hashes, mut low) = (BTreeSet::new(), BTreeSet::new());
        for i in 0..n * n * n {
            for axis in 0..3_u8 {
                let key: LinkKey = ([i % n, i / n % n, i / (n * n)], axis);
                let hash = hasher.hash_one(key);
                hashes.insert(hash);
                low.insert(hash & 0xffff);
            }
        }
        assert_eq!(hashes.len(), (3 * n * n * n) as usize);
        // Random numbers would fill 78 % of the places.
        assert!(low.len() > 50_000, "{}", low.len());
    }
}

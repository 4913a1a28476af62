//! Malformed input against everything that reads from outside.
//!
//! A target takes bytes and must neither panic nor accept what it may not. It gets valid inputs as they are, then
//! recipes: a valid input and edits of it ([`Recipe`]). `cargo test -p scindo-fuzz` tries thousands of recipes per
//! target, `BOLERO_RANDOM_ITERATIONS=10000000` as many as you like. A failure prints its recipe and its seed, which
//! `BOLERO_RANDOM_SEED` repeats. `cargo bolero test -p scindo-fuzz TARGET` hands the same targets to libFuzzer.

use bolero::TypeGenerator;

/// Longest input [bytes]; beyond it lie only limits of length, which the seeds of the targets try.
const LONGEST: usize = 1 << 20;

/// Most edits of one input.
const EDITS: usize = 8;

/// Numbers at which arithmetic goes wrong, in the widths of the formats.
const NUMBERS: [&[u8]; 12] = [
    &[0x00, 0x00, 0x00, 0x00],
    &[0xff, 0xff, 0xff, 0xff],
    &[0xff, 0xff, 0xff, 0x7f],
    &[0x7f, 0xff, 0xff, 0xff],
    &[0x00, 0x00, 0xc0, 0x7f],                         // NaN, little-endian f32
    &[0x7f, 0xc0, 0x00, 0x00],                         // and big-endian
    &[0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xf0, 0x7f], // infinity, little-endian f64
    &[0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xf8, 0x7f], // NaN
    &[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f],
    &[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01], // the largest varint
    &[0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x80],
    &[0x80],
];

/// Words at which readers of text go wrong.
const WORDS: [&str; 20] = [
    "-1",
    "0",
    "1e999",
    "-1e999",
    "nan",
    "inf",
    "4294967296",
    "18446744073709551616",
    "-9223372036854775808",
    "1e-320",
    "\"",
    "'",
    "[",
    "]]",
    "{",
    "\n",
    "\0",
    "=",
    "\u{feff}",
    "é",
];

/// A valid input and what is done to it.
#[derive(Debug, Clone, TypeGenerator)]
pub struct Recipe {
    seed: u16,
    edits: Vec<Edit>,
}

/// One change. Places wrap around at the end of the input.
#[derive(Debug, Clone, TypeGenerator)]
enum Edit {
    Flip { at: u32, bit: u8 },
    Set { at: u32, value: u8 },
    Insert { at: u32, bytes: [u8; 8], count: u8 },
    Remove { at: u32, count: u16 },
    Repeat { at: u32, count: u16, times: u8 },
    End { at: u32 },
    Number { at: u32, which: u8 },
    Word { at: u32, which: u8, replaces: u8 },
    Splice { at: u32, seed: u16, from: u32, count: u16 },
}

impl Recipe {
    /// The input that the recipe makes of one of the `seeds`.
    pub fn bytes(&self, seeds: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = pick(seeds, self.seed).to_vec();
        for edit in self.edits.iter().take(EDITS) {
            edit.apply(&mut bytes, seeds);
            bytes.truncate(LONGEST);
        }
        bytes
    }
}

impl Edit {
    fn apply(&self, bytes: &mut Vec<u8>, seeds: &[Vec<u8>]) {
        let place = |at: u32, length: usize| at as usize % (length + 1);
        match *self {
            Self::Flip { at, bit } => {
                let at = place(at, bytes.len());
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << (bit % 8);
                }
            }
            Self::Set { at, value } => {
                let at = place(at, bytes.len());
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = value;
                }
            }
            Self::Insert { at, bytes: new, count } => {
                let at = place(at, bytes.len());
                replace(bytes, at, 0, &new[..1 + usize::from(count) % new.len()]);
            }
            Self::Remove { at, count } => {
                let at = place(at, bytes.len());
                bytes.drain(at..(at + usize::from(count) % 64).min(bytes.len()));
            }
            Self::Repeat { at, count, times } => {
                let at = place(at, bytes.len());
                let part = bytes[at..(at + usize::from(count) % 256).min(bytes.len())].to_vec();
                // Long repetitions are rare, as they take longest.
                let times = usize::from(if times < 240 { times % 8 } else { times });
                replace(bytes, at, 0, &part.repeat(times));
            }
            Self::End { at } => bytes.truncate(place(at, bytes.len())),
            Self::Number { at, which } => {
                let number = NUMBERS[usize::from(which) % NUMBERS.len()];
                let at = place(at, bytes.len());
                replace(bytes, at, number.len(), number);
            }
            Self::Word { at, which, replaces } => {
                let word = WORDS[usize::from(which) % WORDS.len()].as_bytes();
                let at = place(at, bytes.len());
                replace(bytes, at, usize::from(replaces) % 16, word);
            }
            Self::Splice { at, seed, from, count } => {
                let other = pick(seeds, seed);
                let from = place(from, other.len());
                let part = &other[from..(from + usize::from(count)).min(other.len())];
                let at = place(at, bytes.len());
                replace(bytes, at, 0, part);
            }
        }
    }
}

/// Puts `new` in the place of `count` bytes at `at`, or of fewer where the input ends.
fn replace(bytes: &mut Vec<u8>, at: usize, count: usize, new: &[u8]) {
    let rest = bytes.split_off((at + count).min(bytes.len()));
    bytes.truncate(at);
    bytes.extend_from_slice(new);
    bytes.extend_from_slice(&rest);
}

fn pick(seeds: &[Vec<u8>], which: u16) -> &[u8] {
    if seeds.is_empty() { &[] } else { &seeds[usize::from(which) % seeds.len()] }
}

/// Hands every seed as it is, then recipes, to a target: `attack!(seeds, iterations, |bytes| …)`.
#[macro_export]
macro_rules! attack {
    ($seeds:expr, $iterations:expr, $target:expr) => {{
        let seeds: Vec<Vec<u8>> = $seeds;
        let target = $target;
        seeds.iter().for_each(|seed| target(seed));
        bolero::check!()
            .with_iterations($iterations)
            .with_type::<$crate::Recipe>()
            .for_each(|recipe| target(&recipe.bytes(&seeds)));
    }};
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[test]
    fn recipes_reach_every_kind_of_edit_and_no_place_is_outside() {
        let seeds = vec![Vec::new(), b"solid".to_vec(), vec![7; 300]];
        let changed = AtomicU32::new(0);
        bolero::check!().with_iterations(2000).with_type::<Recipe>().for_each(|recipe| {
            let bytes = recipe.bytes(&seeds);
            assert!(bytes.len() <= LONGEST);
            changed.fetch_add(u32::from(!seeds.contains(&bytes)), Ordering::Relaxed);
        });
        let changed = changed.into_inner();
        assert!(changed > 1000, "{changed} of 2000 recipes change their seed");
    }
}

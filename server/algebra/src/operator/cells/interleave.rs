//! Numbers of eight cells, by cell and by lane.

use scindo_matter::element::{LANES, Lanes, Vector8};

/// Lane l of `to[k]` becomes number k of `from[l]`.
#[inline(always)]
pub(super) fn interleave<V: Vector8, const N: usize>(from: &[&[f32; N]; LANES], to: &mut [Lanes; N]) {
    let whole = N / LANES * LANES;
    for at in (0..whole).step_by(LANES) {
        let mut rows = [V::splat(0.0); LANES];
        for (row, from) in rows.iter_mut().zip(from) {
            let mut lanes = Lanes::default();
            lanes.0.copy_from_slice(&from[at..at + LANES]);
            *row = V::load(&lanes);
        }
        let columns = V::transposed(rows);
        for k in 0..LANES {
            to[at + k] = columns[k].store();
        }
    }
    for k in whole..N {
        for (lane, from) in from.iter().enumerate() {
            to[k].0[lane] = from[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_comes_to_its_lane() {
        const N: usize = 19;
        let rows: [[f32; N]; LANES] =
            std::array::from_fn(|lane| std::array::from_fn(|k| (100 * lane + k) as f32));
        let mut to = [Lanes::default(); N];
        interleave::<Lanes, N>(&rows.each_ref(), &mut to);
        for (k, to) in to.iter().enumerate() {
            assert_eq!(to.0, rows.map(|row| row[k]));
        }
    }
}

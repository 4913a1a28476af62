//! The matrices of cubes: stiffness by exact integration, and the mass of merged leaves.

use super::dense::Dense;

/// The mass of a cube of mass 1 whose lumped leaves were merged `merged` times: one scalar for every two corners.
///
/// # Derivation
/// M₀ = I/8; merging eight cubes with the trilinear weights T_c of their corners gives Σ T_cᵀ (M/8) T_c. All of these
/// are products over the axes. Along one axis the mass is (a, ½ − a; ½ − a, a) with a = ½ at first, and merging two
/// lines gives a ← (a + 1)/4.
pub(super) fn merged_mass(merged: u8) -> [[f64; 8]; 8] {
    let same = (0..merged).fold(0.5, |a, _| 0.25 * (a + 1.0));
    let entry = |a: usize, b: usize| -> f64 {
        (0..3).map(|k| if (a ^ b) >> k & 1 == 0 { same } else { 0.5 - same }).product()
    };
    std::array::from_fn(|a| std::array::from_fn(|b| entry(a, b)))
}

/// `stiffness` · K + `mass` · M in single precision, for K of side 1.
pub(super) fn cube(K: &[[f64; 24]; 24], stiffness: f64, M: Option<&[[f64; 8]; 8]>, mass: f64) -> Dense {
    Dense::new(|r, s| {
        let inertia = M.filter(|_| r % 3 == s % 3).map_or(0.0, |M| mass * M[r / 3][s / 3]);
        (stiffness * K[r][s] + inertia) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::super::dense::Weights;
    use super::super::level::trilinear;
    use super::*;
    use crate::operator::cells::unit_stiffness;
    use scindo_matter::element::Lanes;
    use scindo_matter::material::Lame;

    /// Weights of the parent's corners in those of its child number `child`.
    fn child_weights(child: usize) -> Weights {
        std::array::from_fn(|c| trilinear([0, 1, 2].map(|k| (child >> k & 1) as i32 + (c >> k & 1) as i32)))
    }

    #[test]
    fn eight_cubes_make_one_of_twice_the_side() {
        let K = unit_stiffness(Lame { mu: 3.0, lambda: 7.0 });
        let fine = cube(&K, 1.0, None, 0.0);
        let mut merged = Dense::default();
        (0..8).for_each(|child| merged.add::<Lanes>(&fine.carried::<Lanes>(&child_weights(child))));
        for (a, b) in merged.wide().as_flattened().iter().zip(K.as_flattened()) {
            assert!((a - 2.0 * b).abs() < 1e-5, "{a} {b}");
        }
    }

    #[test]
    fn merged_mass_is_that_of_the_cube_and_tends_to_the_consistent_one() {
        for merged in 0..6 {
            let (fine, coarse) = (merged_mass(merged), merged_mass(merged + 1));
            let total: f64 = fine.iter().flatten().sum();
            assert!((total - 1.0).abs() < 1e-12);
            for (a, b) in (0..64).map(|pair| (pair / 8, pair % 8)) {
                let mut sum = 0.0;
                for T in (0..8).map(child_weights) {
                    for (c, d) in (0..64).map(|pair| (pair / 8, pair % 8)) {
                        sum += f64::from(T[c][a]) * fine[c][d] / 8.0 * f64::from(T[d][b]);
                    }
                }
                assert!((sum - coarse[a][b]).abs() < 1e-15, "{merged}: {a}, {b}");
            }
        }
        // ∫ N_a² = 1/27, ∫ N_a N_b = 1/216 of opposite corners.
        let M = merged_mass(9);
        assert!((M[0][0] - 1.0 / 27.0).abs() < 1e-5 && (M[0][7] - 1.0 / 216.0).abs() < 1e-5);
    }
}

//! Ways to lump the mass of a cut element.

/// How the mass of a cut element is distributed to its degrees of freedom; formulas in [`super`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lumping {
    /// Full matrix ∫ρ N_i N_j over standard and enriched functions.
    Consistent,
    /// Row sums within the standard block and within the enriched block.
    RowSum,
    /// Diagonal of the consistent matrix, scaled to the mass of the element.
    Hrz,
    /// As [`Hrz`](Self::Hrz), with the enriched block scaled to its own row-sum mass.
    HrzBlockMass,
    /// The weighted diagonal as printed in the thesis, (3.44) and (3.45): m M_ii / Σ_j M_ij. It does not
    /// conserve mass: the total is 4/3 m for a bar and 1.6 m for a tet.
    HrzAsPrinted,
    /// m/n, and for enriched degrees of freedom (m/n) times the mean of ψ_i².
    Menouillard,
    /// The masses of the copies, ρ ∫ N_i dV over the piece, expressed in the basis: a 2×2 block for every
    /// node, M_ua included. It is the only lumped mass that gives each piece its true weight.
    Copies,
}

impl Lumping {
    /// All lumpings, in the order of the table.
    pub const ALL: [Self; 7] = [
        Self::Consistent,
        Self::RowSum,
        Self::Hrz,
        Self::HrzBlockMass,
        Self::HrzAsPrinted,
        Self::Menouillard,
        Self::Copies,
    ];

    /// Whether the matrix is the same linear map in every basis, so that the frequencies are independent of
    /// it.
    pub fn is_of_the_pieces(self) -> bool {
        matches!(self, Self::Consistent | Self::Copies)
    }
}

//! The enrichment functions.

/// Side of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// H = −1.
    Left,
    /// H = +1.
    Right,
}

impl Side {
    /// The Heaviside function H = ∓1 of this side.
    pub fn sign(self) -> f64 {
        match self {
            Side::Left => -1.0,
            Side::Right => 1.0,
        }
    }
}

/// Basis in which the displacements of a cut element are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Enrichment {
    /// ψ_i = H: both sides of the cut depend on every enriched degree of freedom.
    Heaviside,
    /// ψ_i = (H − H_i)/2: vanishes at node i and on its whole side.
    ShiftedHeaviside,
    /// ψ_i = |H + H_i|/2: the same space, supported on the side of the node.
    OwnSide,
    /// Copies of the nodes as degrees of freedom, one set for each piece.
    Substitution,
}

impl Enrichment {
    /// All bases, in the order of the table.
    pub const ALL: [Self; 4] = [Self::Heaviside, Self::ShiftedHeaviside, Self::OwnSide, Self::Substitution];

    /// Coefficients (c_u, c_a) of node i's two degrees of freedom on the piece of side `piece`, where N_i is
    /// multiplied by c_u u_i + c_a a_i. For substitution u_i is the copy of side L and a_i that of side R.
    pub fn coefficients(self, piece: Side, node: Side) -> [f64; 2] {
        let (H, H_i) = (piece.sign(), node.sign());
        match self {
            Self::Heaviside => [1.0, H],
            Self::ShiftedHeaviside => [1.0, (H - H_i) / 2.0],
            Self::OwnSide => [1.0, (H + H_i).abs() / 2.0],
            Self::Substitution => [(1.0 - H) / 2.0, (1.0 + H) / 2.0],
        }
    }
}

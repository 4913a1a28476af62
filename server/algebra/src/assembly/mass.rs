//! How masses are shared among nodes, and the integrals that they come from.

/// How the mass of a cut linear tetrahedron is shared among its nodes where integrals of the shape functions would not
/// do.
///
/// A thin piece has nodes whose shape functions are small everywhere in it. Integrals give these nodes almost no mass,
/// and the critical time step vanishes with the thickness.
///
/// # Source
/// Menouillard, Réthoré, Combescure, Bung 2006; Rozycki et al. 2008 (constant-strain elements).
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum MassSharing {
    /// Evenly. A piece then has the same fraction w of its element's mass as of its stiffness, so its highest frequency
    /// is that of the whole element, however it is cut. The mass of a body, and with it momentum, is what it was before
    /// the cut. Only the centre of mass within a cut element is not exact.
    Even,
    /// By the integrals, with a floor of half of the even share. Nodes of thin pieces get more mass than there is; all
    /// others keep exactly theirs.
    Floored,
}

/// ∫ N_a N_b dV of the elements, upper triangles packed by rows.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) enum Products {
    /// Products per unit volume, the same for every element.
    Scaled(Vec<f64>),
    /// Products of every element, one element after the other [m³].
    PerElement(Vec<f64>),
}

impl Products {
    /// Per unit volume of a linear tetrahedron: (1 + δ_ab)/20.
    pub(super) fn linear_tet() -> Self {
        let M: [[f64; 4]; 4] =
            std::array::from_fn(|a| std::array::from_fn(|b| if a == b { 0.1 } else { 0.05 }));
        Products::Scaled(pack(&M).collect())
    }
}

/// The upper triangle of a symmetric matrix, by rows.
pub(super) fn pack<const N: usize>(M: &[[f64; N]; N]) -> impl Iterator<Item = f64> + '_ {
    M.iter().enumerate().flat_map(|(a, row)| row[a..].iter().copied())
}

//! Claims of the thesis on the critical time step of cut elements, compared with computed results.

use super::{
    CutElement, Enrichment, EnrichmentError, Lumping, StepFigure, cut_places, regular_tet, thesis_figures,
};

/// A statement of Jeřábková 2007 §3.2, compared with what is computed here.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// Figure or equation.
    pub place: &'static str,
    /// The statement as printed.
    pub printed: &'static str,
    /// Whether the computation confirms it.
    pub holds: bool,
    /// The computed values.
    pub found: String,
    /// The correction, or what follows from the result.
    pub instead: &'static str,
}

/// Position of the cut near an end of the bar at which a claim is tested.
const SLIVER: f64 = 1e-4;
/// Positions of the cut on each curve.
const PLACES: usize = 60;

/// All claims of the section. Only their wording is fixed in advance: the values, and whether a claim holds,
/// are computed.
pub fn thesis_claims() -> Result<Vec<Claim>, EnrichmentError> {
    let figures = thesis_figures(&cut_places(PLACES))?;
    Ok(vec![
        consistent(&figures),
        heaviside(&figures),
        shifted(&figures)?,
        weighted_diagonal()?,
        substitution(&figures)?,
        enrichment_lumping(&figures),
        tets(&figures),
        diagonal_masses()?,
    ])
}

/// Smallest and largest value of one curve; (∞, 0) if there is none.
fn range(figures: &[StepFigure], number: &str, lumping: Lumping) -> (f64, f64) {
    let curves = figures.iter().filter(|f| f.number == number).flat_map(|f| &f.curves);
    let of = curves.filter(|c| c.lumping == lumping);
    of.fold((f64::INFINITY, 0.0), |(low, high), c| (low.min(c.least()), high.max(c.most())))
}

fn consistent(figures: &[StepFigure]) -> Claim {
    let (least, _) = range(figures, "3.10(b)", Lumping::Consistent);
    Claim {
        place: "Figs. 3.10, 3.11",
        printed: "the consistent mass matrix leads to instability when the cut is close to a node",
        holds: least < 0.05,
        found: format!(
            "Δt_c/Δt_c⁰ down to {least:.4} at c = {SLIVER:e}; the same in all bases, which span the same \
             displacements"
        ),
        instead: "implicit integration, whose step it does not limit",
    }
}

fn heaviside(figures: &[StepFigure]) -> Claim {
    let ranges = [Lumping::RowSum, Lumping::Hrz, Lumping::Menouillard].map(|l| range(figures, "3.10(a)", l));
    let (low, high) = ranges[0];
    let same = ranges.iter().all(|r| (r.0 - low).abs() + (r.1 - high).abs() < 1e-12);
    Claim {
        place: "Fig. 3.10(a)",
        printed: "H: all three lumpings give the same matrix, and 0.7 to 1.0 of the step of the uncut element",
        holds: same && low > 0.7 && high <= 1.0 + 1e-12,
        found: format!("{low:.4} to {high:.4} for all three: (2 max(c, 1 − c))^−½"),
        instead: "as printed",
    }
}

fn shifted(figures: &[StepFigure]) -> Result<Claim, EnrichmentError> {
    let at =
        |lumping| CutElement::unit_bar(SLIVER)?.critical_step_ratio(Enrichment::ShiftedHeaviside, lumping);
    let (row_sum, hrz) = (at(Lumping::RowSum)?, at(Lumping::Hrz)?);
    let (kept, _) = range(figures, "3.10(b)", Lumping::Menouillard);
    let (printed, _) = range(figures, "3.10(b)", Lumping::HrzAsPrinted);
    let (drawn, _) = range(figures, "3.10(b) as drawn", Lumping::RowSum);
    let (weighted, weighted_high) = range(figures, "3.10(b) as drawn", Lumping::Hrz);
    Ok(Claim {
        place: "Fig. 3.10(b), (3.45)",
        printed: "(H − H_i)/2: all three lumpings keep 0.75, the weighted diagonal slightly more",
        holds: row_sum.min(hrz).min(kept) >= 0.75,
        found: format!(
            "row sums {row_sum:.4} and the weighted diagonal {hrz:.4} at c = {SLIVER:e}, → 0 with c; only \
             Menouillard's masses keep {kept:.4} for every c (and the formula as printed, which adds mass, \
             {printed:.4}). The printed curves, at least {drawn:.4} and {weighted:.4} to {weighted_high:.4}, \
             come out with functions on the node's own side, |H + H_i|/2, which do not vanish at the node"
        ),
        instead: "Menouillard's masses (3.47) in an explicit integrator, or copies with a floor under \
                  their mass",
    })
}

fn weighted_diagonal() -> Result<Claim, EnrichmentError> {
    let total = |element: CutElement| {
        let M = element.mass(Enrichment::ShiftedHeaviside, Lumping::HrzAsPrinted);
        let n = element.n_nodes();
        M.diagonal().rows(0, n).sum() / element.mass_kg()
    };
    let (bar, tet) = (total(CutElement::unit_bar(0.5)?), total(regular_tet(1, 0.5)?));
    Ok(Claim {
        place: "(3.44)",
        printed: "the weighted diagonal m M_ii / Σ_j M_ij is a lumped mass matrix",
        holds: (bar - 1.0).abs() < 1e-9 && (tet - 1.0).abs() < 1e-9,
        found: format!("its standard block weighs {bar:.4} m for a bar and {tet:.4} m for a tet"),
        instead: "m M_ii / Σ_k M_kk (Hinton, Rock, Zienkiewicz 1976)",
    })
}

fn substitution(figures: &[StepFigure]) -> Result<Claim, EnrichmentError> {
    let [row_sum, hrz] = [Lumping::RowSum, Lumping::Hrz].map(|lumping| range(figures, "3.11", lumping).0);
    Ok(Claim {
        place: "Fig. 3.11",
        printed: "substituted degrees of freedom: row sums and the weighted diagonal lead to instability for \
                  a cut near a node",
        holds: row_sum < 0.05 && hrz < 0.05,
        found: format!("down to {row_sum:.4} and {hrz:.4} at c = {SLIVER:e}, as √c and as c"),
        instead: "implicit integration, or a floor under the mass of copies",
    })
}

fn enrichment_lumping(figures: &[StepFigure]) -> Claim {
    let (low, high) = range(figures, "3.11", Lumping::Menouillard);
    Claim {
        place: "Fig. 3.11",
        printed: "Menouillard's lumping cannot be applied to substituted degrees of freedom",
        holds: low.is_infinite(),
        found: format!(
            "with (m/n) times the share of the piece on each of its nodes it keeps {low:.4} to {high:.4}: each \
             piece is the uncut element, lighter and softer in the same ratio"
        ),
        instead: "these masses where the step must not fall; each piece then has its true mass, but not its \
                  centre of mass",
    }
}

fn tets(figures: &[StepFigure]) -> Claim {
    let (low, high) = range(figures, "3.12", Lumping::Menouillard);
    let (row_sum, _) = range(figures, "3.12", Lumping::RowSum);
    Claim {
        place: "Fig. 3.12",
        printed: "tets with (H − H_i)/2 and Menouillard's masses: the same order of magnitude wherever the cut is",
        holds: low > 0.7 && high <= 1.0 + 1e-12,
        found: format!("{low:.4} to {high:.4} (row sums: down to {row_sum:.4})"),
        instead: "0.7 of the step of the uncut element covers every cut",
    }
}

fn diagonal_masses() -> Result<Claim, EnrichmentError> {
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    let mut copies = 0.0_f64;
    for v in [0.003, 0.1, 0.5, 0.9, 0.997] {
        for below in [1, 2] {
            let tet = regular_tet(below, v)?;
            for g in tet.free_fall(Enrichment::ShiftedHeaviside, Lumping::Menouillard)? {
                (low, high) = (low.min(g), high.max(g));
            }
            for g in tet.free_fall(Enrichment::ShiftedHeaviside, Lumping::Copies)? {
                copies = copies.max((g - 1.0).abs());
            }
        }
    }
    Ok(Claim {
        place: "(3.46), (3.47) with M_ua = 0",
        printed: "a diagonal mass matrix of u and a is enough",
        holds: low > 0.999 && high < 1.001,
        found: format!(
            "the pieces of a tet fall freely, under their weight, at {low:.4} g to {high:.4} g: gravity alone \
             tears them apart; with the masses of the copies at g to {copies:.0e}"
        ),
        instead: "masses of the copies; in u and a that is a 2×2 block for every node, \
                  [[m_r + m_v, ±m_v], [±m_v, m_v]]",
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn claims_hold_and_fail_where_the_errata_say() {
        let claims = thesis_claims().unwrap();
        let verdicts: Vec<_> = claims.iter().map(|c| (c.place, c.holds)).collect();
        let expected = [
            ("Figs. 3.10, 3.11", true),
            ("Fig. 3.10(a)", true),
            ("Fig. 3.10(b), (3.45)", false),
            ("(3.44)", false),
            ("Fig. 3.11", true),
            ("Fig. 3.11", false),
            ("Fig. 3.12", true),
            ("(3.46), (3.47) with M_ua = 0", false),
        ];
        assert_eq!(verdicts, expected, "{claims:#?}");
    }
}

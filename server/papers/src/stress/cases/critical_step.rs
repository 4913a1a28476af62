//! The critical time step of a cut element: the curves of Jeřábková's thesis, Figs. 3.10 to 3.12.

use scindo_study::report::chart::{Chart, Line};

use crate::enrichment::basis::Enrichment;
use crate::enrichment::cut_element::CutElement;
use crate::enrichment::lumping::Lumping;
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;

/// Shown beside the numbered cases.
pub(super) const CASE: Case = Case {
    number: None,
    name: "critical-step",
    title: "Critical time step of a cut element",
    set_up: "A bar of one element, cut at c: critical step of an explicit integrator over that of the uncut \
             element with lumped mass, for every enrichment and every way to lump its mass (Jeřábková 2007, \
             Figs. 3.10 to 3.12).",
    rule: "The closed forms hold: Heaviside, lumped: 1/√(2 max(c, 1−c)); shifted Heaviside with Menouillard's \
           lumping: √(2/3) for every c; copies of the nodes with Menouillard's lumping: 1 for every c.",
    source: "Jeřábková 2007, (3.43) to (3.47); Menouillard 2006",
    quick: true,
    run,
};

const ENRICHMENTS: [(Enrichment, &str, &str); 4] = [
    (Enrichment::Heaviside, "Heaviside, H", "Fig. 3.10a: generalised Heaviside"),
    (
        Enrichment::ShiftedHeaviside,
        "shifted Heaviside, (H − H_i)/2",
        "Fig. 3.10b: shifted Heaviside, as its formula says",
    ),
    (Enrichment::OwnSide, "own side, |H + H_i|/2", "Fig. 3.10b as printed: supported on the node's own side"),
    (Enrichment::Substitution, "copies of the nodes", "Fig. 3.11: degrees of freedom substituted by copies"),
];

const LUMPINGS: [(Lumping, &str); 4] = [
    (Lumping::Consistent, "consistent"),
    (Lumping::RowSum, "row sums"),
    (Lumping::Hrz, "scaled diagonal (HRZ)"),
    (Lumping::Menouillard, "Menouillard"),
];

/// Positions of the cut, dense at both ends.
fn positions() -> Vec<f64> {
    let end = [1e-4, 3e-4, 1e-3, 3e-3];
    let inner = (1..100).map(|k| f64::from(k) / 100.0);
    end.into_iter().chain(inner).chain(end.iter().rev().map(|c| 1.0 - c)).collect()
}

fn run(_: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let ratio = |c: f64, e: Enrichment, l: Lumping| {
        CutElement::unit_bar(c).and_then(|bar| bar.critical_step_ratio(e, l))
    };
    let mut off = [0.0_f64; 3];
    for (enrichment, name, title) in ENRICHMENTS {
        let mut chart = Chart::new(title, "position c of the cut", "critical step / uncut");
        for (lumping, words) in LUMPINGS {
            let mut points = Vec::new();
            for c in positions() {
                // Bases whose consistent mass degenerates at the ends have no result there.
                let Ok(value) = ratio(c, enrichment, lumping) else { continue };
                points.push([c, value]);
                let error = |exact: f64| (value / exact - 1.0).abs();
                match (enrichment, lumping) {
                    (_, Lumping::Consistent) => {}
                    (Enrichment::Heaviside, _) => {
                        off[0] = off[0].max(error((2.0 * c.max(1.0 - c)).sqrt().recip()))
                    }
                    (Enrichment::ShiftedHeaviside, Lumping::Menouillard) => {
                        off[1] = off[1].max(error((2.0_f64 / 3.0).sqrt()))
                    }
                    (Enrichment::Substitution, Lumping::Menouillard) => off[2] = off[2].max(error(1.0)),
                    _ => {}
                }
            }
            let least = points.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
            evidence.tell(format!("least ratio, {name}, {words}"), least, "");
            chart.lines.push(Line { name: words.to_owned(), points });
        }
        evidence.charts.push(chart);
    }
    evidence.at_most("Heaviside, lumped, against 1/√(2 max(c, 1−c))", off[0], 1e-9, "off");
    evidence.at_most("shifted Heaviside, Menouillard, against √(2/3)", off[1], 1e-9, "off");
    evidence.at_most("copies, Menouillard, against 1", off[2], 1e-9, "off");
    let small = ratio(0.01, Enrichment::ShiftedHeaviside, Lumping::RowSum)?;
    evidence.at_most("shifted Heaviside, row sums, at c = 0.01", small, 0.05, "");
    let small = ratio(0.01, Enrichment::ShiftedHeaviside, Lumping::Hrz)?;
    evidence.at_most("shifted Heaviside, scaled diagonal, at c = 0.01", small, 0.05, "");
    evidence.notes.push(
        "One claim of the thesis does not hold. It says that with the shifted Heaviside function every lumping \
         keeps the critical step above 0.75 of the uncut one. The printed curves follow from functions supported \
         on the node's own side, |H + H_i|/2, not from (H − H_i)/2. With the formula, the sliver beside the cut \
         keeps a mass of about c²/2 (row sums) or c³ (scaled diagonal) but a stiffness of about c, and the step \
         goes to zero with c. Only Menouillard's lumping stays bounded."
            .to_owned(),
    );
    evidence.notes.push(
        "Equation (3.44) of the thesis divides by the row sum and therefore does not conserve mass (factor 4/3 \
         in one dimension, 1.6 in three). Scaled diagonals here follow Hinton, Rock and Zienkiewicz. Diagonal \
         masses of standard and enriched degrees of freedom, (3.46) and (3.47), give fragments the wrong \
         inertia: they fall with 0.40 to 0.997 g. The solver uses copies of the nodes with the masses of their \
         pieces, so every fragment falls with g (see the case free-fall)."
            .to_owned(),
    );
    Ok(evidence)
}

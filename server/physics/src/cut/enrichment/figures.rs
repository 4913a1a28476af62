//! The critical time step of cut elements as plotted in the thesis: the curves of its Figs. 3.10–3.12.

use nalgebra::Vector3;

use super::{CutElement, Enrichment, EnrichmentError, Lumping};
use crate::material::Lame;

/// One figure to plot: the critical time step against the position of the cut.
#[derive(Clone, Debug, PartialEq)]
pub struct StepFigure {
    /// Number in Jeřábková 2007.
    pub number: &'static str,
    /// Title of the figure.
    pub title: &'static str,
    /// Label of the horizontal axis, 0 … 1. The vertical axis is Δt_c/Δt_c⁰, 0 … 1.2, where Δt_c⁰ belongs to
    /// the uncut element with masses m/n.
    pub abscissa: &'static str,
    /// The curves of the figure.
    pub curves: Vec<StepCurve>,
}

/// One curve of a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct StepCurve {
    /// Label in the legend.
    pub name: &'static str,
    /// The basis of the curve.
    pub enrichment: Enrichment,
    /// The mass matrix of the curve.
    pub lumping: Lumping,
    /// Points (position of the cut, Δt_c/Δt_c⁰).
    pub points: Vec<[f64; 2]>,
}

impl StepCurve {
    /// Smallest Δt_c/Δt_c⁰ on the curve.
    pub fn least(&self) -> f64 {
        self.points.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min)
    }

    /// Largest Δt_c/Δt_c⁰ on the curve.
    pub fn most(&self) -> f64 {
        self.points.iter().map(|p| p[1]).fold(0.0, f64::max)
    }
}

/// Mass matrices in the figures, with their labels.
const MASSES: [(&str, Lumping); 6] = [
    ("consistent", Lumping::Consistent),
    ("row sums (3.42), (3.43)", Lumping::RowSum),
    ("weighted diagonal, kept mass", Lumping::Hrz),
    ("weighted diagonal as printed (3.44), (3.45)", Lumping::HrzAsPrinted),
    ("Menouillard (3.46), (3.47)", Lumping::Menouillard),
    ("masses of the copies", Lumping::Copies),
];

/// `n` positions of a cut in (0, 1), symmetric, half of them close to the ends, from 1e-4 on.
pub fn cut_places(n: usize) -> Vec<f64> {
    let near = (n / 4).max(2);
    let mut low: Vec<f64> = (0..near).map(|i| 1e-4 * 300_f64.powf(i as f64 / near as f64)).collect();
    let rest = n.saturating_sub(2 * near).max(1);
    let inner = (0..rest).map(|i| 0.03 + 0.94 * (i as f64 + 0.5) / rest as f64);
    let high: Vec<f64> = low.iter().rev().map(|c| 1.0 - c).collect();
    low.extend(inner);
    low.extend(high);
    low
}

/// Figs. 3.10(a), 3.10(b), the data that 3.10(b) was drawn with, 3.11 and 3.12, at these positions of the
/// cut.
pub fn thesis_figures(places: &[f64]) -> Result<Vec<StepFigure>, EnrichmentError> {
    let c = "position of the cut c";
    let bar = |number, title, enrichment| -> Result<StepFigure, EnrichmentError> {
        let curve = |(name, lumping)| {
            let point =
                |&c: &f64| Ok([c, CutElement::unit_bar(c)?.critical_step_ratio(enrichment, lumping)?]);
            let points = places.iter().map(point).collect::<Result<_, _>>()?;
            Ok(StepCurve { name, enrichment, lumping, points })
        };
        let curves = MASSES.into_iter().map(curve).collect::<Result<_, _>>()?;
        Ok(StepFigure { number, title, abscissa: c, curves })
    };
    Ok(vec![
        bar("3.10(a)", "bar, generalised Heaviside function", Enrichment::Heaviside)?,
        bar("3.10(b)", "bar, shifted enrichment (H − H_i)/2", Enrichment::ShiftedHeaviside)?,
        bar("3.10(b) as drawn", "bar, functions |H + H_i|/2 on the node's own side", Enrichment::OwnSide)?,
        bar("3.11", "bar, substituted degrees of freedom", Enrichment::Substitution)?,
        tet_figure(places)?,
    ])
}

fn tet_figure(places: &[f64]) -> Result<StepFigure, EnrichmentError> {
    let shifted = Enrichment::ShiftedHeaviside;
    let lines = [
        ("Menouillard (3.47), one node cut off", 1, Lumping::Menouillard),
        ("Menouillard (3.47), two nodes on each side", 2, Lumping::Menouillard),
        ("row sums (3.43), one node cut off", 1, Lumping::RowSum),
        ("weighted diagonal, one node cut off", 1, Lumping::Hrz),
        ("masses of the copies, one node cut off", 1, Lumping::Copies),
    ];
    let curve = |(name, below, lumping)| {
        let point = |&v: &f64| Ok([v, regular_tet(below, v)?.critical_step_ratio(shifted, lumping)?]);
        let points = places.iter().map(point).collect::<Result<_, _>>()?;
        Ok(StepCurve { name, enrichment: shifted, lumping, points })
    };
    Ok(StepFigure {
        number: "3.12",
        title: "regular tet, shifted enrichment, ν = 0.35",
        abscissa: "volume below the cut v",
        curves: lines.into_iter().map(curve).collect::<Result<_, _>>()?,
    })
}

/// A regular tet, ν = 0.35. A plane that divides all edges it cuts in the same ratio has the part `v` of the
/// volume and the first `below` nodes (1, or else 2) below it.
pub fn regular_tet(below: usize, v: f64) -> Result<CutElement, EnrichmentError> {
    let x = |x, y, z| Vector3::new(x, y, z);
    let corners = [x(1.0, 1.0, 1.0), x(1.0, -1.0, -1.0), x(-1.0, 1.0, -1.0), x(-1.0, -1.0, 1.0)];
    // E = 1: λ = ν/((1+ν)(1−2ν)), μ = 1/(2(1+ν)).
    let lame = Lame { mu: 1.0 / 2.7, lambda: 0.35 / (1.35 * 0.3) };
    let t = edge_parameter(below, v);
    CutElement::tet(&corners, lame, 1.0, std::array::from_fn(|i| if i < below { -t } else { 1.0 - t }))
}

/// t with t³ = v for one node below the cut, 3t² − 2t³ = v for two.
fn edge_parameter(below: usize, v: f64) -> f64 {
    let below_cut = |t: f64| if below == 1 { t.powi(3) } else { t * t * (3.0 - 2.0 * t) };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let t = 0.5 * (low + high);
        if below_cut(t) < v { low = t } else { high = t }
    }
    0.5 * (low + high)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn places_are_inside_and_symmetric() {
        let places = cut_places(40);
        assert_eq!(places.len(), 40);
        assert!(places.windows(2).all(|p| 0.0 < p[0] && p[0] < p[1] && p[1] < 1.0));
        assert!(places.iter().zip(places.iter().rev()).all(|(a, b)| (a + b - 1.0).abs() < 1e-12));
    }

    #[test]
    fn every_curve_has_a_finite_point_for_every_place() {
        let figures = thesis_figures(&cut_places(12)).unwrap();
        assert_eq!(figures.len(), 5);
        for curve in figures.iter().flat_map(|f| &f.curves) {
            assert!(curve.points.len() == 12 && curve.least() > 0.0 && curve.most() < 1.5, "{curve:?}");
        }
    }
}

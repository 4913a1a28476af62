//! The critical time step of cut elements: the curves of Jeřábková 2007, Figs. 3.10 to 3.12, and how pieces fall.

use nalgebra::Vector3;
use scindo_physics::material::Lame;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::{Plots, Table, Unit};

use super::basis::Enrichment;
use super::cut_element::CutElement;
use super::error::EnrichmentError;
use super::lumping::Lumping;

/// Mass matrices in the figures, with their labels.
const MASSES: [(&str, Lumping); 6] = [
    ("consistent", Lumping::Consistent),
    ("row sums (3.42), (3.43)", Lumping::RowSum),
    ("weighted diagonal, kept mass", Lumping::Hrz),
    ("weighted diagonal as printed (3.44), (3.45)", Lumping::HrzAsPrinted),
    ("Menouillard (3.46), (3.47)", Lumping::Menouillard),
    ("masses of the copies", Lumping::Copies),
];
/// Bases of the bar, with the figures that show them.
const BARS: [(Enrichment, &str); 4] = [
    (Enrichment::Heaviside, "Fig. 3.10(a): bar, H"),
    (Enrichment::ShiftedHeaviside, "Fig. 3.10(b): bar, (H − H_i)/2"),
    (Enrichment::OwnSide, "Fig. 3.10(b) as drawn: bar, |H + H_i|/2 on the node's own side"),
    (Enrichment::Substitution, "Fig. 3.11: bar, copies of the nodes"),
];
/// Nodes of a regular tet that the cut leaves below it.
const TETS: [(usize, &str); 2] = [
    (1, "Fig. 3.12: regular tet, (H − H_i)/2, one node cut off"),
    (2, "Fig. 3.12: regular tet, (H − H_i)/2, two nodes on each side"),
];
/// Positions of the cut on each curve.
const PLACES: usize = 60;
/// Parts of the tet below the cut for which its pieces fall.
const FALLING: [f64; 5] = [0.003, 0.1, 0.5, 0.9, 0.997];

/// The curves: critical step over that of the uncut element with masses m/n, by the place of the cut; and a table of
/// their least values, with how fast the pieces of a tet fall under their weight.
///
/// # Errors
/// A mass matrix that is singular.
pub fn critical_steps() -> Result<(Plots, Table), EnrichmentError> {
    let mut table = Table::new(
        "Critical step of a cut element",
        "The least over all places of the cut, over the step of the uncut element with masses m/n. The last two columns \
         are the accelerations of the pieces of a regular tet in free fall, over g: 1 is right.",
        &[
            ("least step", Unit::Number),
            ("largest step", Unit::Number),
            ("slowest fall", Unit::Number),
            ("fastest fall", Unit::Number),
        ],
    );
    let mut charts = Vec::new();
    let bars = BARS.map(|(basis, title)| (basis, title, None));
    let tets = TETS.map(|(below, title)| (Enrichment::ShiftedHeaviside, title, Some(below)));
    for (basis, title, below) in bars.into_iter().chain(tets) {
        let place = if below.is_some() { "volume below the cut v" } else { "position of the cut c" };
        let mut chart = Chart::new(title, place, "critical step / uncut");
        for (name, lumping) in MASSES {
            let element = |c| below.map_or_else(|| CutElement::unit_bar(c), |below| regular_tet(below, c));
            let point = |&c: &f64| Ok([c, element(c)?.critical_step_ratio(basis, lumping)?]);
            let points: Vec<[f64; 2]> = cut_places(PLACES).iter().map(point).collect::<Result<_, _>>()?;
            let least = points.iter().fold(f64::INFINITY, |m, p| m.min(p[1]));
            let most = points.iter().fold(0.0_f64, |m, p| m.max(p[1]));
            let [slow, fast] = if below == Some(1) { fall(basis, lumping)?.map(Some) } else { [None; 2] };
            table.row(format!("{title}: {name}"), &[Some(least), Some(most), slow, fast]);
            chart.lines.push(Line { name: name.to_owned(), points });
        }
        charts.push(chart);
    }
    let caption =
        "Critical time step of an explicit integrator, by the place of the cut (Jeřábková 2007, §3.2)";
    Ok((Plots { caption: caption.to_owned(), plots: Vec::new(), charts }, table))
}

/// Smallest and largest acceleration of a piece of a cut tet under its weight, over g.
fn fall(basis: Enrichment, lumping: Lumping) -> Result<[f64; 2], EnrichmentError> {
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    for (below, v) in [1, 2].into_iter().flat_map(|below| FALLING.map(|v| (below, v))) {
        for g in regular_tet(below, v)?.free_fall(basis, lumping)? {
            (low, high) = (low.min(g), high.max(g));
        }
    }
    Ok([low, high])
}

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

/// A regular tet, ν = 0.35. A plane that divides all edges it cuts in the same ratio has the part `v` of the
/// volume and the first `below` nodes (1, or else 2) below it.
fn regular_tet(below: usize, v: f64) -> Result<CutElement, EnrichmentError> {
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

    /// What Jeřábková 2007 §3.2 claims, where it holds and where it does not.
    #[test]
    fn steps_and_falls_are_those_of_the_errata() {
        let (plots, table) = critical_steps().unwrap();
        assert_eq!(plots.charts.len(), 6);
        let of = |figure: &str, mass: &str| -> [Option<f64>; 4] {
            let row = table.rows.iter().find(|r| r.name.starts_with(figure) && r.name.contains(mass));
            row.unwrap().values[..].try_into().unwrap()
        };
        let step = |figure, mass| of(figure, mass).map(|x| x.unwrap_or(f64::NAN));
        let (h, shifted, drawn, copies) =
            ("Fig. 3.10(a)", "Fig. 3.10(b): ", "Fig. 3.10(b) as drawn", "Fig. 3.11");
        // A consistent mass fails beside a node in every basis; H keeps 0.7 with every diagonal mass.
        assert!(step(shifted, "consistent")[0] < 0.05);
        let [low, high, ..] = step(h, "row sums");
        assert!(low > 0.7 && high <= 1.0 + 1e-12);
        for mass in ["kept mass", "Menouillard"] {
            let [other_low, other_high, ..] = step(h, mass);
            assert!((other_low - low).abs() + (other_high - high).abs() < 1e-12);
        }
        // The shifted basis keeps 0.75 with Menouillard's masses only; the printed curves are of the own side.
        assert!(step(shifted, "row sums")[0] < 0.05 && step(shifted, "kept mass")[0] < 0.05);
        assert!(step(shifted, "Menouillard")[0] > 0.75 && step(drawn, "row sums")[0] > 0.7);
        // Copies: row sums and scaled diagonals fail, Menouillard's masses keep the whole step.
        assert!(step(copies, "row sums")[0] < 0.05 && step(copies, "kept mass")[0] < 0.05);
        assert!(step(copies, "Menouillard")[0] > 1.0 - 1e-9);
        for (_, title) in TETS {
            let [low, high, ..] = step(title, "Menouillard");
            assert!(low > 0.7 && high <= 1.0 + 1e-12);
        }
        // With diagonal masses gravity alone tears the pieces apart.
        let [_, _, slow, fast] = step(TETS[0].1, "Menouillard");
        assert!(!(slow > 0.999 && fast < 1.001));
        let [_, _, slow, fast] = step(TETS[0].1, "masses of the copies");
        assert!((slow - 1.0).abs().max((fast - 1.0).abs()) < 1e-9);
    }

    /// The weighted diagonal as printed, m M_ii / Σ_j M_ij, is no lumped mass: it adds mass.
    #[test]
    fn the_printed_diagonal_does_not_keep_mass() {
        for (element, expected) in
            [(CutElement::unit_bar(0.5).unwrap(), 4.0 / 3.0), (regular_tet(1, 0.5).unwrap(), 1.6)]
        {
            let M = element.mass(Enrichment::ShiftedHeaviside, Lumping::HrzAsPrinted);
            let total = M.diagonal().rows(0, element.n_nodes()).sum() / element.mass_kg();
            assert!((total - expected).abs() < 1e-9, "{total}");
        }
    }
}

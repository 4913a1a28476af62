//! Nienhuys' cantilever: small strain, against beam theory.

use scindo_study::case::{Case, Point, Truth};
use scindo_study::design::Block;
use scindo_study::design::axes::{Factor, cells, elements};
use scindo_study::trial::Protocol;
use scindo_study::trial::distance::Goal;
use scindo_study::trial::series::Series;

use super::gold::probes_override;
use super::shared::{axes, labels, load, names};

/// Length, height, depth [m]; Young's modulus [Pa]; load [N].
const BEAM: Beam = Beam { l: 1.2, h: 0.2, d: 0.3, young: 1e6, force: 3.0 };

/// Builds the case.
pub(super) fn case(quick: bool) -> Case {
    let body = ["beam".to_owned()];
    let mut probes = Vec::new();
    let mut truth = Vec::new();
    for x in [0.25, 0.5, 0.75, 1.0].map(|share| share * BEAM.l) {
        for (what, y) in [("axis", 0.5 * BEAM.h), ("top", BEAM.h)] {
            let id = format!("{what}-{}", (100.0 * x).round());
            probes.push(Point { id, point_m: [x, y, 0.5 * BEAM.d], side: None });
            truth.extend(BEAM.displacement(x, y));
        }
    }
    let tip = -BEAM.displacement(BEAM.l, 0.5 * BEAM.h)[1];
    let all = [[8, 2, 2], [16, 4, 4], [24, 6, 6], [32, 8, 8], [40, 10, 10], [48, 12, 12]];
    let (meshes, base) = if quick { (&all[..2], all[1]) } else { (&all[..], all[2]) };
    let mesh = cells("beam", meshes, base);
    let axes = axes(&body, "linear", elements(&body, Some("oct6"), "tet4"), mesh, 1e-6);
    let meshes = labels(&axes, Factor::Mesh);
    let small: Vec<String> = meshes.iter().take(if quick { 1 } else { 3 }).cloned().collect();
    Case {
        name: "r1".into(),
        title: "R1 · Nienhuys’ cantilever".into(),
        about: "A block of 1.2 × 0.2 × 0.3 m (E = 1 MPa, ν = 0), held at one end, carries 3 N at the other. \
                Strains are small. The meshes and the split into tetrahedra are those of Nienhuys’ Table 3.1, \
                where their errors are 3 % to 29 %, and a coarser one."
            .into(),
        scene: load(include_str!("../../cases/r1.toml"), &[probes_override("beam", &probes)]),
        bodies: body.to_vec(),
        protocol: Protocol::Static,
        fewest_frames: 0,
        notes: Vec::new(),
        goal: Goal::new("deflection of the tip", 6, [0.0, -1.0, 0.0]),
        truth: Truth::Known {
            series: Series { frames: vec![0], displacement_m: truth, energy_j: vec![0.5 * BEAM.force * tip] },
            goal: None,
            error_bar: 2e-3,
            law: "linear".into(),
            source: "Timoshenko’s beam (κ = 5/6): the tip sinks by 8.784 mm. Beam theory is itself a model; \
                     a block held at one whole face is within 0.2 % of it"
                .into(),
        },
        blocks: vec![
            Block(vec![(Factor::Element, names(&["tet4", "hex8"])), (Factor::Mesh, meshes.clone())]),
            Block(vec![(Factor::Element, names(&["tet10"])), (Factor::Mesh, small)]),
            Block(vec![(Factor::Tolerance, names(&["1e-2", "1e-4"])), (Factor::Mesh, meshes.clone())]),
            Block(vec![(Factor::Solver, names(&["cholesky"])), (Factor::Mesh, meshes)]),
        ],
        axes,
        colour: Factor::Element,
        shape: Factor::Solver,
    }
}

/// A cantilever with a load at its tip.
struct Beam {
    l: f64,
    h: f64,
    d: f64,
    young: f64,
    force: f64,
}

impl Beam {
    /// Displacement [m] at (x, y) by Timoshenko's theory with κ = 5/6 and ν = 0, so G = E/2:
    /// w = F/EI (l x²/2 − x³/6) + F x/(κGA), and the section turns by F/EI (l x − x²/2).
    fn displacement(&self, x: f64, y: f64) -> [f64; 3] {
        let Self { l, h, d, young, force } = self;
        let bending = young * d * h.powi(3) / 12.0;
        let shear = 5.0 / 6.0 * 0.5 * young * h * d;
        let sinks = force / bending * (l * x * x / 2.0 - x.powi(3) / 6.0) + force * x / shear;
        let turns = force / bending * (l * x - x * x / 2.0);
        [(y - 0.5 * h) * turns, -sinks, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timoshenko_at_the_tip() {
        let tip = BEAM.displacement(BEAM.l, 0.5 * BEAM.h);
        assert!((tip[1] + 8.784e-3).abs() < 1e-9 && tip[0] == 0.0, "{tip:?}");
    }
}

//! Schoch's beam, half cut, under gravity: against stored solutions.

use scindo_study::case::Case;
use scindo_study::case::LAWS;
use scindo_study::design::Block;
use scindo_study::design::axes::{Factor, cells, elements};
use scindo_study::trial::Protocol;
use scindo_study::trial::distance::Goal;

use super::gold::Gold;
use super::shared::{axes, labels, load, names};

/// Builds the case.
pub(super) fn case(quick: bool) -> Case {
    let body = ["beam".to_owned()];
    let gold = Gold::read(include_str!("../../cases/r2-tc1.gold.json"));
    // The mesh 5×10×33 has faces beside the cut. The others have a layer of faces in the cut.
    let all = [[2, 4, 14], [4, 8, 26], [5, 10, 33], [6, 12, 40]];
    let (meshes, base) = if quick { (&all[..2], all[0]) } else { (&all[..], all[1]) };
    let mesh = cells("beam", meshes, base);
    let axes = axes(&body, "corotational", elements(&body, Some("tet5"), "tet4"), mesh, 1e-4);
    let meshes = labels(&axes, Factor::Mesh);
    let small: Vec<String> = meshes.iter().take(if quick { 1 } else { 4 }).cloned().collect();
    Case {
        name: "r2-tc1".into(),
        title: "R2-TC1 · Schoch’s cut beam".into(),
        about: "A beam of 30 × 60 × 200 mm (E = 300 kPa, ν = 0.35), held at its base and cut through to half \
                its depth. Gravity bends it sideways and opens the cut; the tip moves by half the length. The \
                mesh 5×10×33 does not follow the cut, the others do."
            .into(),
        scene: load(include_str!("../../cases/r2-tc1.toml"), &[gold.probes("beam")]),
        bodies: body.to_vec(),
        protocol: Protocol::Static,
        fewest_frames: 0,
        notes: Vec::new(),
        goal: Goal::new("sideways deflection of the tip", gold.probe("tip_mid"), [1.0, 0.0, 0.0]),
        truth: gold.truth("stvk", None, "Stored solution for St. Venant–Kirchhoff"),
        blocks: vec![
            Block(vec![(Factor::Law, names(&LAWS)), (Factor::Mesh, meshes.clone())]),
            Block(vec![(Factor::Tolerance, names(&["1e-2"])), (Factor::Mesh, small.clone())]),
            Block(vec![(Factor::Solver, names(&["cholesky"])), (Factor::Mesh, small.clone())]),
            Block(vec![(Factor::Element, names(&["tet4 node-averaged"])), (Factor::Mesh, small)]),
        ],
        axes,
        colour: Factor::Law,
        shape: Factor::Element,
    }
}

//! Properties that every cut state must have, whatever was cut. They become figures with bounds.

use scindo_physics::body::Body;
use scindo_physics::cut::Flaws;

use super::support::pieces;
use crate::stress::evidence::Evidence;

/// Records the flaws of a cut state as figures.
pub(super) fn tell(flaws: &Flaws, evidence: &mut Evidence) {
    evidence.exactly(
        "edges and vertices at which the surface is not closed and 2-manifold",
        flaws.surface,
        0,
    );
    evidence.at_most("largest |Σ w_c − 1| of an element", flaws.fractions, 1e-12, "");
    evidence.at_most("volume of copies and surface against the mesh", flaws.volume, 1e-10, "");
    evidence.exactly("parts of the material less parts by shared copies", flaws.parts, 0);
}

/// Largest |Σ mass of a part's copies / (density · its volume) − 1|.
pub(super) fn mass_of_parts(body: &Body) -> f64 {
    let density = body.material().density_kg_m3;
    let mut volume = vec![0.0; body.parts().len()];
    for (piece, element) in pieces(body) {
        let part = body.parts().of_copy[piece.copies[0] as usize] as usize;
        volume[part] += piece.fraction * element;
    }
    let off = |(mass, volume): (&f64, &f64)| (mass / (density * volume) - 1.0).abs();
    body.parts().mass.iter().zip(&volume).map(off).fold(0.0, f64::max)
}

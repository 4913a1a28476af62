//! Checks that the size of a body fits its stiffness and density, to detect files in millimetres.

use std::fmt;

use nalgebra::Vector3;
use serde::Serialize;

/// Largest side [m] plausible for a body that a person presses and cuts.
const LARGEST_BODY_M: f64 = 3.0;
/// Smallest plausible longest side [m].
const SMALLEST_BODY_M: f64 = 1e-3;
/// Longest side [m] at which a suggested scale aims (organs: 0.03 to 0.5 m).
const TYPICAL_BODY_M: f64 = 0.15;
/// Compression by its own weight above which a standing body collapses.
const COLLAPSE: f64 = 0.5;
/// Compression by its own weight below which a body is so stiff for its size that it looks rigid.
const RIGID: f64 = 1e-9;

/// A suspected error in units, with the numbers behind it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum ScaleWarning {
    /// The body is larger than anything that is pressed and cut. The file is likely in mm, cm or dm.
    TooLarge {
        /// Longest side as scaled now [m].
        longest_m: f64,
        /// Factor for `scale`, relative to the file's unit.
        suggested_scale: f64,
    },
    /// The body is smaller than a millimetre.
    TooSmall {
        /// Longest side as scaled now [m].
        longest_m: f64,
        /// Factor for `scale`, relative to the file's unit.
        suggested_scale: f64,
    },
    /// Its own weight crushes it: ρ g L / E.
    Collapses {
        /// Compression under its own weight, ρ g L / E.
        sag: f64,
        /// Stiffness [Pa] that would keep it below 10 %.
        stiff_enough_pa: f64,
    },
    /// A wave crosses the body in far less than a microsecond and its weight has no effect: stiffness or
    /// density is wrong.
    Rigid {
        /// Compression under its own weight, ρ g L / E.
        sag: f64,
        /// Time that a pressure wave takes to cross, L / √(E/ρ) [s].
        crossing_s: f64,
    },
    /// The density is that of no tissue or technical material.
    Density {
        /// Density given [kg/m³].
        density_kg_m3: f64,
    },
}

impl fmt::Display for ScaleWarning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            ScaleWarning::TooLarge { longest_m, suggested_scale } => write!(
                f,
                "the body is {longest_m:.3} m long: is the file in {}? then set scale = {suggested_scale}",
                unit_of(suggested_scale)
            ),
            ScaleWarning::TooSmall { longest_m, suggested_scale } => write!(
                f,
                "the body is only {longest_m:.3e} m long: was it scaled twice? consider scale = {suggested_scale}"
            ),
            ScaleWarning::Collapses { sag, stiff_enough_pa } => write!(
                f,
                "its own weight would compress the body by {:.0} % (ρ g L / E): \
                 check young_pa (≥ {stiff_enough_pa:.1e} keeps it below 10 %), density_kg_m3 and scale",
                100.0 * sag
            ),
            ScaleWarning::Rigid { sag, crossing_s } => write!(
                f,
                "at this size and stiffness the body is rigid: weight compresses it by {sag:.1e}, \
                 a wave crosses it in {crossing_s:.1e} s; is young_pa in pascals?"
            ),
            ScaleWarning::Density { density_kg_m3 } => write!(
                f,
                "density_kg_m3 = {density_kg_m3} is outside 10..=25000 kg/m³ (soft tissue: about 1000): \
                 was it given in g/cm³ or t/mm³?"
            ),
        }
    }
}

fn unit_of(scale: f64) -> &'static str {
    match scale {
        1e-3 => "millimetres",
        1e-2 => "centimetres",
        1e-1 => "decimetres",
        _ => "another unit",
    }
}

/// Compares the size of a body with its material. `scale` is the factor already applied to the file;
/// suggestions replace it.
pub fn check_scale(
    min_m: &Vector3<f64>,
    max_m: &Vector3<f64>,
    scale: f64,
    density_kg_m3: f64,
    young_pa: f64,
) -> Vec<ScaleWarning> {
    const STANDARD_GRAVITY: f64 = 9.81;
    let longest_m = (max_m - min_m).max();
    let mut warnings = Vec::new();
    if !(10.0..=25_000.0).contains(&density_kg_m3) {
        warnings.push(ScaleWarning::Density { density_kg_m3 });
    }
    if longest_m > LARGEST_BODY_M {
        warnings.push(ScaleWarning::TooLarge { longest_m, suggested_scale: suggestion(longest_m, scale) });
    } else if longest_m < SMALLEST_BODY_M {
        warnings.push(ScaleWarning::TooSmall { longest_m, suggested_scale: suggestion(longest_m, scale) });
    }
    let sag = density_kg_m3 * STANDARD_GRAVITY * longest_m / young_pa;
    if !warnings.is_empty() {
        // A wrong unit explains all further suspicions.
        return warnings;
    }
    if sag > COLLAPSE {
        let stiff_enough_pa = 10.0 * density_kg_m3 * STANDARD_GRAVITY * longest_m;
        warnings.push(ScaleWarning::Collapses { sag, stiff_enough_pa });
    } else if sag < RIGID {
        let crossing_s = longest_m * (density_kg_m3 / young_pa).sqrt();
        warnings.push(ScaleWarning::Rigid { sag, crossing_s });
    }
    warnings
}

/// The scale among m, dm, cm, mm and µm that brings the body closest to the size of an organ.
fn suggestion(longest_m: f64, scale: f64) -> f64 {
    let in_file = longest_m / scale;
    let distance = |s: f64| (in_file * s / TYPICAL_BODY_M).ln().abs();
    [1.0, 1e-1, 1e-2, 1e-3, 1e-6]
        .into_iter()
        .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
        .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warnings(longest: f64, scale: f64, density: f64, young: f64) -> Vec<ScaleWarning> {
        check_scale(&Vector3::zeros(), &(longest * Vector3::new(1.0, 0.5, 0.3)), scale, density, young)
    }

    #[test]
    fn a_liver_in_metres_is_fine() {
        assert_eq!(warnings(0.16, 1.0, 1060.0, 5e3), []);
        assert_eq!(warnings(0.2, 0.001, 1070.0, 3e5), []);
    }

    #[test]
    fn millimetres_and_centimetres_are_recognised() {
        assert!(
            warnings(160.0, 1.0, 1060.0, 5e3)
                .iter()
                .any(|w| matches!(w, ScaleWarning::TooLarge { suggested_scale: 0.001, .. }))
        );
        let text = warnings(16.0, 1.0, 1060.0, 1e6)[0].to_string();
        assert!(text.contains("scale = 0.01") && text.contains("centimetres"), "{text}");
        // Scaled already, but by the wrong factor. The suggestion replaces the factor.
        assert!(
            warnings(16.0, 0.1, 1060.0, 1e6)
                .iter()
                .any(|w| matches!(w, ScaleWarning::TooLarge { suggested_scale: 0.001, .. }))
        );
    }

    #[test]
    fn weight_and_stiffness_that_do_not_fit_are_named() {
        assert!(matches!(warnings(0.5, 1.0, 1000.0, 50.0)[..], [ScaleWarning::Collapses { .. }]));
        assert!(matches!(warnings(0.1, 1.0, 1000.0, 1e13)[..], [ScaleWarning::Rigid { .. }]));
        assert!(matches!(warnings(0.1, 1.0, 1.06, 1e3)[..], [ScaleWarning::Density { .. }]));
        assert!(matches!(warnings(1e-4, 1.0, 1000.0, 1e3)[..], [ScaleWarning::TooSmall { .. }]));
    }
}

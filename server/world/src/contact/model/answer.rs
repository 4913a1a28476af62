//! How stiffly hand and tissue answer a move of the tool: within a step of the server, at once, and after the tissue has
//! followed.
//!
//! # Derivation
//! Tissue of stiffness k and viscosity β (a Kelvin–Voigt solid: f = k (u + β u̇), its inertia left out) and the spring k_h of
//! the hand act in series. A step of implicit Euler of length h sees k (1 + β/h) for the tissue. Between steps the pair is a
//! standard linear solid: it answers a move at once with k_h, relaxes to 1/(1/k_h + 1/k), and takes β k / (k_h + k) for it. A
//! client that bridges a delay needs these, because its own moves are old by then.

use crate::contact::compliance::Compliance;

/// Stiffness of hand and tissue in series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Over a step of the server [N/m].
    pub in_step: f64,
    /// At once [N/m].
    pub at_once: f64,
    /// After the tissue has followed [N/m]; zero if nothing is known about the tissue.
    pub relaxed: f64,
    /// Time constant between the two [s].
    pub relaxation_s: f64,
}

/// What is known about the tissue under a tool.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tissue {
    /// Compliance in a step [m/N] that the tool has learned on this body; none before the first touch.
    pub learned: Option<f64>,
    /// Young's modulus [Pa].
    pub young_pa: f64,
    /// Viscosity β [s].
    pub viscosity_s: f64,
    /// Length of a step [s].
    pub step_s: f64,
}

impl Answer {
    /// The answer to a hand of stiffness `hand` [N/m] whose tool has a tip of radius `radius_m` [m].
    pub fn new(hand: f64, radius_m: f64, tissue: &Tissue) -> Option<Self> {
        let usable = hand > 0.0 && tissue.step_s > 0.0 && tissue.young_pa > 0.0;
        let viscous = tissue.viscosity_s / tissue.step_s;
        let guess = || Compliance::new(tissue.young_pa, radius_m, viscous).value();
        let in_step = tissue.learned.unwrap_or_else(guess);
        let at_rest = in_step * (1.0 + viscous);
        let relaxed = 1.0 / (1.0 / hand + at_rest);
        let answer = Self {
            in_step: 1.0 / (1.0 / hand + in_step),
            at_once: if tissue.viscosity_s > 0.0 { hand } else { relaxed },
            relaxed,
            relaxation_s: tissue.viscosity_s / (hand * at_rest + 1.0),
        };
        (usable && answer.in_step.is_finite() && answer.relaxed.is_finite()).then_some(answer)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn viscous_tissue_is_softer_at_rest_and_elastic_tissue_is_not() {
        let tissue = Tissue { learned: Some(1.0 / 300.0), young_pa: 3e4, viscosity_s: 0.01, step_s: 0.01 };
        let answer = Answer::new(600.0, 0.005, &tissue).unwrap();
        assert!((answer.in_step - 200.0).abs() < 1e-9 && (answer.relaxed - 120.0).abs() < 1e-9);
        assert!(answer.at_once == 600.0 && (answer.relaxation_s - 0.01 * 150.0 / 750.0).abs() < 1e-9);
        let elastic = Answer::new(600.0, 0.005, &Tissue { viscosity_s: 0.0, ..tissue }).unwrap();
        assert!(elastic.at_once == elastic.relaxed && elastic.in_step == elastic.relaxed);
    }

    #[test]
    fn a_first_touch_is_answered_by_the_modulus() {
        let tissue = Tissue { learned: None, young_pa: 3e4, viscosity_s: 0.01, step_s: 0.01 };
        let answer = Answer::new(600.0, 0.005, &tissue).unwrap();
        // 600 N/m in series with 5/3 of 30 kPa times 5 mm.
        assert!((answer.relaxed - 1.0 / (1.0 / 600.0 + 1.0 / 250.0)).abs() < 1e-9);
        assert_eq!(Answer::new(600.0, 0.005, &Tissue { step_s: 0.0, ..tissue }), None);
        assert_eq!(Answer::new(0.0, 0.005, &tissue), None);
    }
}

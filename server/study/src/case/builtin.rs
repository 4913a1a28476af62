//! The cases that come with the program.

use super::definition::Case;
use super::{bar, cantilever, cut_beam, cutting};

/// Names of the cases that come with the program.
pub const NAMES: [&str; 7] =
    ["r1", "r2-tc1", "bar-rest", "bar-motion", "cut-tc1", "cut-tc2force", "cut-tc2strip"];

/// Builds the case `name`. `quick` leaves out slow configurations.
pub fn builtin(name: &str, quick: bool) -> Option<Case> {
    match name {
        "r1" => Some(cantilever::case(quick)),
        "r2-tc1" => Some(cut_beam::case(quick)),
        "bar-rest" => Some(bar::at_rest(quick)),
        "bar-motion" => Some(bar::in_motion(quick)),
        "cut-tc1" => Some(cutting::case(cutting::Pull::Gravity, quick)),
        "cut-tc2force" => Some(cutting::case(cutting::Pull::Force, quick)),
        "cut-tc2strip" => Some(cutting::case(cutting::Pull::Strip, quick)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::definition::Truth;
    use crate::design::axes::Factor;
    use crate::design::design;

    #[test]
    fn every_case_has_a_base_and_a_bounded_number_of_points() {
        for name in NAMES {
            for quick in [false, true] {
                let case = builtin(name, quick).expect(name);
                let all = design(&case.axes, &case.blocks);
                assert!((10..=160).contains(&all.len()), "{name}: {} points", all.len());
                let law = case.axes.iter().find(|axis| axis.factor == Factor::Law).expect("law");
                assert!(law.find(case.truth.law()).is_some(), "{name}: the reference has a law of the axis");
                if let Truth::Known { series, .. } = &case.truth {
                    assert_eq!(series.width(), 3 * case.scene.checked().probes.len(), "{name}");
                }
            }
        }
    }
}

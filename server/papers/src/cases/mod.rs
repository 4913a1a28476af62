//! The accuracy cases of papers: scenes with a goal and a known solution. The study of accuracy runs them by name.

pub mod cutting;

mod bar;

mod cantilever;

mod cut_beam;

mod gold;

mod shared;

use scindo_study::case::Case;

/// Names of the cases.
pub const NAMES: [&str; 7] =
    ["r1", "r2-tc1", "bar-rest", "bar-motion", "cut-tc1", "cut-tc2force", "cut-tc2strip"];

/// The cases that `name` stands for: one, a group, or none.
pub fn cases(name: &str, quick: bool) -> Vec<Case> {
    match name {
        "bar" => vec![bar::at_rest(quick), bar::in_motion(quick)],
        "cutting" => {
            let pulls = [cutting::Pull::Gravity, cutting::Pull::Force, cutting::Pull::Strip];
            pulls.map(|pull| cutting::case(pull, quick)).to_vec()
        }
        name => builtin(name, quick).into_iter().collect(),
    }
}

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
#[allow(clippy::unwrap_used)]
mod tests;

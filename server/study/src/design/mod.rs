//! Selects the configurations to try: one factor at a time around a base, and factorial blocks.

pub mod axes;

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use axes::{Axis, Factor, Setting};

/// One setting for every axis of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Configuration {
    /// Factor and setting, in the order of the axes.
    pub choices: Vec<(Factor, Setting)>,
}

impl Configuration {
    /// The configuration with every axis at its base.
    pub fn base(axes: &[Axis]) -> Self {
        let choice = |axis: &Axis| Some((axis.factor, axis.base()?.clone()));
        Self { choices: axes.iter().filter_map(choice).collect() }
    }

    /// The setting of a factor, if the case varies it.
    pub fn setting(&self, factor: Factor) -> Option<&Setting> {
        self.choices.iter().find(|(f, _)| *f == factor).map(|(_, setting)| setting)
    }

    /// The label of a factor's setting; empty if the case does not vary it.
    pub fn label(&self, factor: Factor) -> &str {
        self.setting(factor).map_or("", |setting| &setting.label)
    }

    /// The same with one setting replaced.
    pub fn with(&self, factor: Factor, setting: &Setting) -> Self {
        let mut changed = self.clone();
        match changed.choices.iter_mut().find(|(f, _)| *f == factor) {
            Some((_, old)) => *old = setting.clone(),
            None => changed.choices.push((factor, setting.clone())),
        }
        changed
    }

    /// Overrides of the scene; later ones win.
    pub fn overrides(&self) -> Vec<String> {
        self.choices.iter().flat_map(|(_, setting)| setting.set.iter().cloned()).collect()
    }

    /// Number of threads that work on a step.
    pub fn threads(&self) -> usize {
        self.setting(Factor::Threads).and_then(|setting| setting.threads).unwrap_or(1)
    }

    /// All labels in words, such as `corotational, tet4, 40×8×8, …`.
    pub fn words(&self) -> String {
        let words: Vec<String> = self
            .choices
            .iter()
            .filter(|(_, setting)| setting.label != "auto")
            .map(|(factor, setting)| match factor {
                Factor::Tolerance if !setting.label.contains(' ') => format!("tolerance {}", setting.label),
                Factor::Threads if setting.label == "1" => "1 thread".to_owned(),
                Factor::Threads => format!("{} threads", setting.label),
                Factor::Step => format!("step {}", setting.label),
                Factor::Precision => format!("{} precision", setting.label),
                _ => setting.label.clone(),
            })
            .collect();
        words.join(", ")
    }

    /// Key that identifies the configuration within its case.
    pub fn key(&self) -> String {
        let parts: Vec<String> =
            self.choices.iter().map(|(f, setting)| format!("{}={}", f.name(), setting.label)).collect();
        parts.join(" ")
    }
}

/// A factorial block: every combination of these labels, the other axes at their base.
#[derive(Debug, Clone, PartialEq)]
pub struct Block(pub Vec<(Factor, Vec<String>)>);

impl Block {
    /// A block from literal labels.
    pub fn of(factors: &[(Factor, &[&str])]) -> Self {
        let owned = |labels: &[&str]| labels.iter().map(|l| (*l).to_owned()).collect();
        Self(factors.iter().map(|(factor, labels)| (*factor, owned(labels))).collect())
    }
}

/// The configurations of a case, each of them once, base first. Labels that narrowing has removed from an
/// axis are left out.
pub fn design(axes: &[Axis], blocks: &[Block]) -> Vec<Configuration> {
    let base = Configuration::base(axes);
    let mut all = vec![base.clone()];
    for axis in axes {
        all.extend(axis.settings.iter().map(|setting| base.with(axis.factor, setting)));
    }
    for Block(factors) in blocks {
        let mut grown = vec![base.clone()];
        for (factor, labels) in factors {
            let axis = axes.iter().find(|axis| axis.factor == *factor);
            let settings: Vec<&Setting> = match axis {
                Some(axis) => labels.iter().filter_map(|label| axis.find(label)).collect(),
                None => continue,
            };
            grown =
                grown.iter().flat_map(|c| settings.iter().map(|setting| c.with(*factor, setting))).collect();
        }
        all.extend(grown);
    }
    let mut seen = BTreeSet::new();
    all.retain(|configuration| seen.insert(configuration.key()));
    all
}

/// Narrows an axis to the settings with these labels. If the base is removed, the first remaining setting
/// becomes the base.
pub fn narrow(axes: &mut [Axis], factor: Factor, labels: &[String]) {
    for axis in axes.iter_mut().filter(|axis| axis.factor == factor) {
        let base = axis.base().map(|setting| setting.label.clone()).unwrap_or_default();
        axis.settings.retain(|setting| labels.contains(&setting.label));
        axis.base = axis.settings.iter().position(|setting| setting.label == base).unwrap_or(0);
    }
}

#[cfg(test)]
mod tests {
    use super::axes::{threads, words};
    use super::*;

    fn axes() -> Vec<Axis> {
        let bodies = ["b".to_owned()];
        vec![
            words(Factor::Law, &bodies, "law", &["linear", "corotational", "stvk"], "corotational"),
            words(Factor::Element, &bodies, "element", &["tet4", "hex8"], "tet4"),
            threads(&[1, 2]),
        ]
    }

    #[test]
    fn one_factor_at_a_time_around_the_base() {
        let all = design(&axes(), &[]);
        assert_eq!(all.len(), 1 + 2 + 1 + 1);
        assert_eq!(all[0].key(), "law=corotational element=tet4 threads=1");
        assert_eq!(all[4].threads(), 2);
    }

    #[test]
    fn a_block_adds_every_combination_once() {
        let block = Block::of(&[
            (Factor::Law, &["linear", "corotational"]),
            (Factor::Element, &["tet4", "hex8", "tet10"]),
        ]);
        let all = design(&axes(), &[block]);
        assert_eq!(all.len(), 5 + 1, "only linear × hex8 is new; tet10 is no setting of the axis");
    }

    #[test]
    fn narrowing_moves_the_base_if_it_must() {
        let mut axes = axes();
        narrow(&mut axes, Factor::Law, &["linear".to_owned(), "stvk".to_owned()]);
        assert_eq!(design(&axes, &[])[0].label(Factor::Law), "linear");
    }
}

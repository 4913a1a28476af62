//! Stored reference solutions: displacements of probes and elastic energy, by law.

use scindo_study::case::{Point, Truth, probe_tables};
use scindo_study::trial::series::Series;
use serde::Deserialize;

/// Contents of a file of reference solutions.
#[derive(Debug, Clone, Deserialize)]
pub struct Gold {
    /// Material points at which displacements are stored.
    pub probes: Vec<Point>,
    /// One solution per law.
    pub fields: Vec<GoldField>,
}

/// The solution of one law.
#[derive(Debug, Clone, Deserialize)]
pub struct GoldField {
    /// Name of the law.
    pub law: String,
    /// Relative half-width of its error bar.
    pub error_bar: f64,
    /// How the solution was computed.
    pub source: String,
    /// Elastic energy [J].
    pub energy_j: f64,
    /// Displacement of every probe [m].
    pub displacement_m: Vec<[f64; 3]>,
}

impl Gold {
    /// Parses one of the files stored with this crate.
    pub fn read(text: &str) -> Self {
        serde_json::from_str(text).expect("the file is part of the program and a test reads it")
    }

    /// Override that adds the probes to the scene.
    pub fn probes(&self, body: &str) -> String {
        probes_override(body, &self.probes)
    }

    /// Index of a probe.
    pub fn probe(&self, id: &str) -> usize {
        self.probes.iter().position(|probe| probe.id == id).unwrap_or(0)
    }

    /// The solution of `law` as the truth of a case.
    pub fn truth(&self, law: &str, goal: Option<f64>, from: &str) -> Truth {
        let field = self.fields.iter().find(|field| field.law == law);
        let field = field.expect("the file is part of the program and a test reads it");
        Truth::Known {
            series: Series {
                frames: vec![0],
                displacement_m: field.displacement_m.iter().flatten().copied().collect(),
                energy_j: vec![field.energy_j],
            },
            goal,
            error_bar: field.error_bar,
            law: law.to_owned(),
            source: format!("{from}: {}", field.source),
        }
    }
}

/// The override `probe=[…]` for points of a body.
pub(super) fn probes_override(body: &str, points: &[Point]) -> String {
    format!("probe=[{}]", probe_tables(body, points))
}

//! Material points at which the runs of a case are compared.

use serde::Deserialize;

/// A material point.
#[derive(Debug, Clone, Deserialize)]
pub struct Point {
    /// Id of the probe.
    pub id: String,
    /// Rest position [m].
    pub point_m: [f64; 3],
    /// Vector towards the side of a cut on which the point lies.
    pub side: Option<[f64; 3]>,
}

/// The inline tables of these probes, separated by commas.
pub fn probe_tables(body: &str, points: &[Point]) -> String {
    let table = |Point { id, point_m, side }: &Point| {
        let side = side.map_or(String::new(), |side| format!(", side = {side:?}"));
        format!("{{ id = \"{id}\", body = \"{body}\", point_m = {point_m:?}{side} }}")
    };
    points.iter().map(table).collect::<Vec<_>>().join(", ")
}

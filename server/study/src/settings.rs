//! What is asked of a study.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::design::axes::Factor;

/// Which cases, in which time, and narrowed to what.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Names of cases (see [`NAMES`](crate::case::NAMES)) and paths of scene files.
    pub cases: Vec<String>,
    /// Where the results go; finished points there are taken over.
    pub out: PathBuf,
    /// Coarse meshes and short runs only.
    pub quick: bool,
    /// Time that the study may take [s]; none: as long as the cases of the program take, and
    /// [`SCENE_S`] for a scene.
    pub within_s: Option<f64>,
    /// Recommend a configuration that fits this time per solution or frame [ms].
    pub budget_ms: Option<f64>,
    /// Simulated time of scenes in motion [s].
    pub seconds: Option<f64>,
    /// Factors and the labels that are kept of them; factors that are not named keep all.
    pub only: Vec<(Factor, Vec<String>)>,
    /// Replaces the meshes: cells along the longest side.
    pub cells: Vec<usize>,
    /// Raised from elsewhere to end the study; what is finished is kept and shown.
    pub stop: Arc<AtomicBool>,
}

/// Time that a scene's study may take where nothing is said [s]; in a quick study.
pub const SCENE_S: [f64; 2] = [300.0, 40.0];

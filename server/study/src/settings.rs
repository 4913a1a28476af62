//! The user's choices for a study.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::design::axes::Factor;

/// Cases to study, time limits, and factors to narrow.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Paths of scene files, and names that a [library](crate::study::Library) knows.
    pub cases: Vec<String>,
    /// Directory of the results. Finished points in it are taken over.
    pub out: PathBuf,
    /// Use only coarse meshes and short runs.
    pub quick: bool,
    /// Time that the study may take [s]. `None`: as long as the cases of the program take, and [`SCENE_S`]
    /// for a scene.
    pub within_s: Option<f64>,
    /// Time per solution or frame that the recommended configuration must fit [ms].
    pub budget_ms: Option<f64>,
    /// Simulated time of scenes in motion [s].
    pub seconds: Option<f64>,
    /// Labels to keep, by factor. Factors that are not named keep all labels.
    pub only: Vec<(Factor, Vec<String>)>,
    /// Cells along the longest side, which replace the default meshes; empty for the defaults.
    pub cells: Vec<usize>,
    /// Surface of a solid that takes the place of the built-in one in experiments.
    pub surface: Option<PathBuf>,
    /// Raised from elsewhere to end the study. Finished runs are kept and shown.
    pub stop: Arc<AtomicBool>,
}

/// Default time for the study of a scene [s]: a full study, and a quick one.
pub const SCENE_S: [f64; 2] = [300.0, 40.0];

//! Buffers that the calls of a model reuse, so that repeated calls do not allocate.

use std::sync::{Mutex, MutexGuard, PoisonError};

use nalgebra::{Matrix3, Vector3};

/// The buffers of a model; a clone of the model starts with empty ones.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Scratch(#[serde(skip)] Mutex<Buffers>);

/// Intermediate results of node averaging, and those of the parallel passes in `work`.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Buffers {
    pub(super) theta: Vec<f64>,
    pub(super) theta_bar: Vec<f64>,
    pub(super) theta_gradient: Vec<Matrix3<f64>>,
    pub(super) star_gradient: Vec<Vector3<f64>>,
    pub(super) work: Work,
}

/// Contributions of elements, before the nodes gather them.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Work {
    pub(super) energies: Vec<f64>,
    pub(super) forces: Vec<Vector3<f64>>,
    pub(super) blocks: Vec<[f64; 9]>,
    /// Next entry of `incident` that each node gathers.
    pub(super) next: Vec<u32>,
}

impl Clone for Scratch {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Scratch {
    pub(super) fn take(&self) -> MutexGuard<'_, Buffers> {
        // Contents are overwritten before they are read, so a panic elsewhere leaves nothing behind.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

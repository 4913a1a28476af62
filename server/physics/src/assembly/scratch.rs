//! What the calls of a model leave behind for the next one, so that repeated calls do not allocate.

use std::sync::{Mutex, MutexGuard, PoisonError};

use nalgebra::{Matrix3, Vector3};

/// The buffers of a model; a copy of it starts with its own.
#[derive(Debug, Default)]
pub(super) struct Scratch(Mutex<Buffers>);

/// What the two passes of node averaging hand over.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    pub(super) theta: Vec<f64>,
    pub(super) theta_bar: Vec<f64>,
    pub(super) theta_gradient: Vec<Matrix3<f64>>,
    pub(super) star_gradient: Vec<Vector3<f64>>,
    pub(super) work: Work,
}

/// What elements hand over to nodes.
#[derive(Debug, Default)]
pub(super) struct Work {
    pub(super) energies: Vec<f64>,
    pub(super) forces: Vec<Vector3<f64>>,
    pub(super) blocks: Vec<[f64; 9]>,
    /// Next entry of `incident` per node.
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

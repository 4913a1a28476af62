//! Fills a solid with cells of an octree, with progress reports.

use std::fmt;

use rayon::prelude::*;
use scindo_physics::octree::{At, Bits, Lattice, Octree, OctreeError, OctreeSettings, Shape};
use serde::Serialize;

use super::estimate::{MeshEstimate, memory_for_meshes};
use super::health::surface::SurfaceHealth;
use super::progress::{Meshing, Observer};
use crate::quantity::memory;

/// Share of the time after which all cells are known to be inside or outside.
const CLASSIFIED: f64 = 0.7;
/// Bytes per leaf, for the octree and the body made of it.
const BYTES_PER_LEAF: f64 = 1500.0;
/// Bytes per finest cell of the lattice, for membership and the map of leaves.
const BYTES_PER_FINEST: f64 = 5.0;
/// Seconds per row of cells for the inside test, and per cell for everything else.
const SECONDS_PER_ROW: f64 = 30e-6;
const SECONDS_PER_CELL: f64 = 0.3e-6;

/// Result of filling a solid with cells.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct OctreeReport {
    /// Faults found in the surface; `None` for a box.
    pub surface: Option<SurfaceHealth>,
    /// Finest cells across the longest side.
    pub cells: u32,
    /// The coarsest leaves have sides of 2^levels finest cells.
    pub levels: u8,
    /// Side of a finest cell [m].
    pub spacing_m: f64,
    /// Leaves, each an element.
    pub leaves: usize,
    /// Leaves of the finest level.
    pub finest: usize,
    /// Vertices of the cells, hanging ones included.
    pub vertices: usize,
    /// Leaves of each region of another material.
    pub cells_of_region: Vec<usize>,
    /// Volume of the cells [m³].
    pub volume_m3: f64,
    /// Smallest corner of the box around the solid [m].
    pub min_m: [f64; 3],
    /// Largest corner of the box around the solid [m].
    pub max_m: [f64; 3],
}

/// Why a solid was not filled.
#[derive(Debug, thiserror::Error)]
pub enum FillError {
    /// Settings out of range, or nothing to fill.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// The cells would not fit into the memory of this machine.
    #[error("{cells} cells across need about {needs}; {free} may be used here. Use fewer cells")]
    Memory {
        /// Finest cells across the longest side.
        cells: u32,
        /// Memory needed.
        needs: String,
        /// Memory available.
        free: String,
    },
}

/// Fills `shape` with cells. Those whose centres lie in one of `regions` get the number of the last such region
/// as their material, from 1.
///
/// # Errors
/// See [`FillError`].
pub fn fill_observed(
    shape: &dyn Shape,
    settings: OctreeSettings,
    regions: &[&dyn Shape],
    observer: &Observer<'_>,
) -> Result<(Octree, OctreeReport), FillError> {
    let lattice = Lattice::around(shape.bounds(), settings)?;
    let expected = estimate(&lattice, settings.cells);
    let free = memory_for_meshes();
    if expected.bytes > free {
        let (needs, free) = (memory(expected.bytes), memory(free));
        return Err(FillError::Memory { cells: settings.cells, needs, free });
    }
    let tell = |stage, done| observer(Meshing { stage, done, estimate: expected });
    tell("inside and outside", 0.0);
    let all = 1.0 + regions.len() as f64;
    let part = |number: usize, shape| {
        let before = number as f64;
        classify(shape, &lattice, &|done| tell("inside and outside", CLASSIFIED * (before + done) / all))
    };
    let inside = part(0, shape);
    let regions: Vec<Bits> = (1..).zip(regions).map(|(number, region)| part(number, *region)).collect();
    tell("cells", CLASSIFIED);
    let material = |at: At| regions.iter().rposition(|region| region.has(at)).map_or(0, |i| i as u16 + 1);
    let mut octree = Octree::of_cells(lattice, &inside, &material)?;
    octree.cross_boundary(shape);
    let mut cells_of_region = vec![0; regions.len()];
    for cell in octree.cells().iter().filter(|cell| cell.material > 0) {
        cells_of_region[usize::from(cell.material) - 1] += 1;
    }
    let [low, high] = shape.bounds();
    let report = OctreeReport {
        surface: None,
        cells: settings.cells,
        levels: settings.levels,
        spacing_m: lattice.h,
        leaves: octree.cells().len(),
        finest: octree.cells().iter().filter(|cell| cell.level == 0).count(),
        vertices: octree.n_vertices(),
        cells_of_region,
        volume_m3: (0..octree.cells().len()).map(|id| octree.cell_volume(id)).sum(),
        min_m: low.into(),
        max_m: high.into(),
    };
    tell("cells", 1.0);
    Ok((octree, report))
}

/// The finest cells whose centres are inside.
fn classify(shape: &dyn Shape, lattice: &Lattice, tell: &(dyn Fn(f64) + Sync)) -> Bits {
    let mut bits = Bits::new(lattice.size);
    let [nx, ny, nz] = lattice.size.map(|n| n as i32);
    for k in 0..nz {
        let rows: Vec<Vec<bool>> = (0..ny)
            .into_par_iter()
            .map(|j| {
                let mut inside = vec![false; nx as usize];
                shape.contains_row(&|i| lattice.centre([i as i32, j, k]), &mut inside);
                inside
            })
            .collect();
        for (j, row) in (0..ny).zip(&rows) {
            for (i, _) in (0..nx).zip(row).filter(|(_, inside)| **inside) {
                bits.insert([i, j, k] as At);
            }
        }
        tell(f64::from(k + 1) / f64::from(nz));
    }
    bits
}

/// Cost of filling a lattice: at most every sixth finest cell is a leaf where there are coarser ones.
fn estimate(lattice: &Lattice, cells: u32) -> MeshEstimate {
    let [nx, ny, nz] = lattice.size.map(f64::from);
    let finest = nx * ny * nz;
    let leaves = if lattice.levels == 0 { finest } else { finest.min(6.0 * finest.powf(2.0 / 3.0) * 2.0) };
    MeshEstimate {
        cells: cells as usize,
        tets: leaves,
        bytes: leaves * BYTES_PER_LEAF + finest * BYTES_PER_FINEST,
        seconds: ny * nz * SECONDS_PER_ROW + finest * SECONDS_PER_CELL,
    }
}

impl fmt::Display for OctreeReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(
            f,
            "octree: {} leaves, {} of them finest cells of {:.3e} m, {} vertices; {} cells across, {} levels; volume {:.4e} m³",
            self.leaves, self.finest, self.spacing_m, self.vertices, self.cells, self.levels, self.volume_m3
        )?;
        match &self.surface {
            Some(surface) if surface.volume_m3 != 0.0 => {
                let error = self.volume_m3 / surface.volume_m3 - 1.0;
                write!(f, " ({:+.2} % of the surface's)", 100.0 * error)
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::Mutex;

    use nalgebra::Vector3;

    use super::*;
    use crate::mesh_in::{Organ, SolidSurface};

    #[test]
    fn an_organ_is_filled_as_point_by_point_and_reports_progress() {
        let (solid, health) = SolidSurface::new(&Organ::Liver.surface(), 1.0).unwrap();
        let settings = OctreeSettings { cells: 40, levels: 3 };
        let told = Mutex::new(Vec::new());
        let observer = |at: Meshing| told.lock().unwrap().push(at.done);
        let (octree, report) = fill_observed(&solid, settings, &[], &observer).unwrap();
        let single = Octree::fill(&solid, settings, &|_| 0).unwrap();
        assert_eq!(octree.cells(), single.cells());
        assert!((report.volume_m3 / health.volume_m3 - 1.0).abs() < 0.02, "{report}");
        assert!(report.finest > 0 && report.finest < report.leaves);
        let told = told.into_inner().unwrap();
        assert!(told.is_sorted() && told.len() > 10 && told.last() == Some(&1.0));
    }

    #[test]
    fn a_lattice_beyond_the_memory_is_refused() {
        let shape = scindo_physics::octree::BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
        let settings = OctreeSettings { cells: 1000, levels: 0 };
        let error = fill_observed(&shape, settings, &[], &|_| ()).unwrap_err().to_string();
        assert!(error.contains("need about") || error.contains("cells"), "{error}");
    }
}

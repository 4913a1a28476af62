//! Fills a surface with tetrahedra: a body-centred cubic lattice whose nodes and cut edges lie on the
//! surface.
//!
//! Inside and outside come from the generalised winding number, so holes are closed by a plausible membrane
//! and overlapping sheets do not matter. Crossing points come from the triangles themselves. The boundary of
//! the result is the surface at the resolution of the lattice, closed and 2-manifold.
//!
//! # Source
//! Labelle, Shewchuk 2007, "Isosurface stuffing: fast tetrahedral meshes with good dihedral angles";
//! inside and outside by Barill et al. 2018.

mod bcc;
mod stuffing;
mod manifold;
mod lost;

use nalgebra::Vector3;
use scindo_physics::mesh::TetMesh;
use serde::Serialize;

use super::estimate::{CELLS, MeshEstimate, estimate, largest, memory_for_meshes};
use super::health::surface::{CleanSurface, SurfaceHealth, clean_surface};
use super::progress::{Meshing, Observer};
use crate::format::{MeshInError, SurfaceMesh};
use crate::quantity::{digits, memory};
use bcc::Bcc;

/// Share of the volume below which components are dropped as crumbs of thin parts.
const CRUMB: f64 = 0.005;

/// Shares of the total time after which repair and measurement begin.
const REPAIR: f64 = 0.45;
const MEASURES: f64 = 0.8;

/// Result of filling a surface: faults found, sizes, repairs and quality.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LatticeReport {
    /// Faults found in the surface.
    pub surface: SurfaceHealth,
    /// Cubes across the longest side.
    pub cells: usize,
    /// Side of a cube [m].
    pub spacing_m: f64,
    /// Nodes of the result.
    pub nodes: usize,
    /// Tetrahedra of the result.
    pub tets: usize,
    /// Lattice nodes moved onto the surface.
    pub warped_nodes: usize,
    /// Lattice edges cut by the surface.
    pub cut_edges: usize,
    /// Crossings in holes, where no triangle is; placed where the winding number is ½.
    pub hole_crossings: usize,
    /// Nodes doubled because the boundary touched itself there.
    pub split_nodes: usize,
    /// Tetrahedra removed to keep the boundary 2-manifold.
    pub removed_tets: usize,
    /// Connected parts kept.
    pub components: usize,
    /// Connected parts dropped as crumbs.
    pub dropped_components: usize,
    /// Smallest dihedral angle [degrees].
    pub min_dihedral_deg: f64,
    /// Largest dihedral angle [degrees].
    pub max_dihedral_deg: f64,
    /// Smallest mean ratio (1: regular).
    pub min_mean_ratio: f64,
    /// Volume of the tetrahedra [m³].
    pub volume_m3: f64,
    /// (volume of the tetrahedra − volume of the surface) / volume of the surface.
    pub volume_error: f64,
    /// Share of the surface without a tetrahedron within a cell, where thin parts were lost.
    pub lost_share: f64,
    /// The point of the surface farthest from every tetrahedron [m], where a part was lost.
    pub lost_near_m: [f64; 3],
}

/// Fills a surface with `cells` cubes across its longest side. `scale` converts the file's unit to metres.
pub fn lattice_from_surface(
    surface: &SurfaceMesh,
    cells: usize,
    scale: f64,
) -> Result<(TetMesh, LatticeReport), MeshInError> {
    lattice_observed(surface, cells, scale, &|_| ())
}

/// The same, with progress reports to `observer`.
///
/// # Errors
/// Faults of the surface or the arguments, or a mesh that would not fit into memory.
pub(super) fn lattice_observed(
    surface: &SurfaceMesh,
    cells: usize,
    scale: f64,
    observer: &Observer<'_>,
) -> Result<(TetMesh, LatticeReport), MeshInError> {
    if !CELLS.contains(&cells) {
        let (min, max) = (*CELLS.start(), *CELLS.end());
        return Err(MeshInError::Cells { file: surface.file.clone(), cells, min, max });
    }
    if !(scale.is_finite() && scale > 0.0) {
        return Err(MeshInError::Scale { file: surface.file.clone(), scale });
    }
    let (clean, health) = clean_surface(surface, scale)?;
    let expected = affordable(&clean.file, &health, cells)?;
    let tell = |stage, done| observer(Meshing { stage, done, estimate: expected });
    tell("inside and outside", 0.0);
    let lattice = Bcc::around(Vector3::from(health.min_m), Vector3::from(health.max_m), cells);
    let mut report =
        LatticeReport { cells, spacing_m: lattice.spacing, surface: health, ..Default::default() };
    let mut mesh = stuffing::stuff(&lattice, &clean, &mut report, &tell);
    tell("repair", REPAIR);
    manifold::make_manifold(&mut mesh, &mut report);
    manifold::drop_crumbs(&mut mesh, CRUMB, &mut report);
    if mesh.tets.is_empty() {
        return Err(nothing_inside(&clean, cells, &report));
    }
    tell("measures", MEASURES);
    measure(&mesh, &mut report);
    lost::measure(&clean, &mesh, &mut report);
    tell("measures", 1.0);
    Ok((mesh, report))
}

/// The estimated cost of the mesh, or an error if this machine has too little memory for it.
fn affordable(file: &str, health: &SurfaceHealth, cells: usize) -> Result<MeshEstimate, MeshInError> {
    let size_m = [0, 1, 2].map(|axis| health.max_m[axis] - health.min_m[axis]);
    let expected = estimate(size_m, health.volume_m3, cells);
    let free = memory_for_meshes();
    if expected.bytes <= free {
        return Ok(expected);
    }
    Err(MeshInError::Memory {
        file: file.to_owned(),
        cells,
        needs: format!(
            "{} million tetrahedra, which need about {}; {}",
            digits(1e-6 * expected.tets),
            memory(expected.bytes),
            memory(free)
        ),
        largest: largest(size_m, health.volume_m3, free),
    })
}

fn nothing_inside(clean: &CleanSurface, cells: usize, report: &LatticeReport) -> MeshInError {
    MeshInError::NothingInside {
        file: clean.file.clone(),
        cells,
        detail: format!(
            "volume {:.3e} m³, {} holes, {} boundary edges",
            report.surface.volume_m3, report.surface.holes, report.surface.boundary_edges
        ),
    }
}

fn measure(mesh: &TetMesh, report: &mut LatticeReport) {
    let quality = mesh.quality();
    report.nodes = mesh.nodes.len();
    report.tets = mesh.tets.len();
    report.min_dihedral_deg = quality.min_dihedral_rad.to_degrees();
    report.max_dihedral_deg = quality.max_dihedral_rad.to_degrees();
    report.min_mean_ratio = quality.min_mean_ratio.0;
    report.volume_m3 = mesh.volumes().iter().sum();
    report.volume_error = report.volume_m3 / report.surface.volume_m3 - 1.0;
}

#[cfg(test)]
mod tests;

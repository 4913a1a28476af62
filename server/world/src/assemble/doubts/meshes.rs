//! What meshing lost, and elements that a law or a load does not suit.

use crate::body::SimBody;
use crate::mesh_in::{LatticeReport, MeshHealth, OctreeReport, VolumeHealth, most_cells};
use crate::quantity::{coordinates, length, percent};
use crate::scene::raw::{RawElement, RawLocking};
use crate::scene::{BodySpec, LoadKind};

/// Share of its volume that a mesh may lose or gain.
const VOLUME: f64 = 0.03;
/// The volume of a lattice converges with about this power of the cell, as measured on scans of animals.
const ORDER: f64 = 1.5;
/// Share of the surface that may lie outside the mesh.
const LOST: f64 = 0.01;
/// Above this ratio linear tetrahedra lock: they are too stiff by a factor.
const LOCKING: f64 = 0.485;
/// A load that strains a body by more than this is hardly in newtons.
const STRAIN: f64 = 1.0;

/// What is odd about a region of another material that holds no element.
pub(crate) const EMPTY_REGION: &str =
    "no element has its centre in the region, or later regions cover it; make it larger or take a finer mesh";

/// Doubts about the mesh of `body` and whether its material suits it.
pub(super) fn doubts(spec: &BodySpec, body: &SimBody, doubts: &mut Vec<String>) {
    let at = format!("body.{}", spec.id);
    match &body.health {
        Some(MeshHealth::Surface(report)) => lattice(&at, report, doubts),
        Some(MeshHealth::Volume(health)) => volume(&at, health, doubts),
        Some(MeshHealth::Octree(report)) => octree(&at, report, doubts),
        None => {}
    }
    if spec.poisson > LOCKING
        && spec.mechanics.element == RawElement::Tet4
        && spec.mechanics.locking == RawLocking::None
    {
        doubts.push(format!(
            "{at}.poisson: linear tetrahedra lock at {}, and the body will be far too stiff; take 0.45, element \
             = \"tet10\", or law = \"neo-hookean\" with locking = \"node-averaged\"",
            spec.poisson
        ));
    }
    forces(&at, spec, body, doubts);
}

fn octree(at: &str, report: &OctreeReport, doubts: &mut Vec<String>) {
    let solid_m3 = report.surface.as_ref().map_or(0.0, |surface| surface.volume_m3);
    let error = report.volume_m3 / solid_m3 - 1.0;
    if solid_m3 > 0.0 && error.abs() > VOLUME {
        let verb = if error < 0.0 { "lose" } else { "add" };
        let (error, cells) = (percent(error.abs()), report.cells);
        doubts
            .push(format!("{at}.mesh: the cells {verb} {error} of the volume at {cells} cells; raise cells"));
    }
    for (i, _) in report.cells_of_region.iter().enumerate().filter(|(_, cells)| **cells == 0) {
        doubts.push(format!("{at}.material.{i}: {EMPTY_REGION}"));
    }
}

fn lattice(at: &str, report: &LatticeReport, doubts: &mut Vec<String>) {
    let error = report.volume_error;
    if error.abs() > VOLUME {
        let verb = if error < 0.0 { "loses" } else { "adds" };
        let wanted = report.cells as f64 * (error.abs() / VOLUME).powf(1.0 / ORDER);
        let cells = ((wanted / 2.0).ceil() as usize * 2).min(most_cells());
        let holes = report.surface.holes;
        let open = if holes > 0 { " (the surface has holes, so its volume is an estimate)" } else { "" };
        doubts.push(format!(
            "{at}.mesh: meshing {verb} {} of the volume at {} cells{open}; use cells = {cells}",
            percent(error.abs()),
            report.cells
        ));
    }
    if report.lost_share > LOST {
        doubts.push(format!(
            "{at}.mesh: {} of the surface has no element below it, such as near {} m: parts there are thinner than \
             a cell of {}; raise cells, or leave these parts out of the surface",
            percent(report.lost_share),
            coordinates(&report.lost_near_m),
            length(report.spacing_m)
        ));
    }
}

fn volume(at: &str, health: &VolumeHealth, doubts: &mut Vec<String>) {
    if health.overfull_faces > 0 {
        doubts.push(format!(
            "{at}.mesh: {} faces belong to more than two tetrahedra, so elements overlap; repair the file, or \
             remesh its surface with mesh = {{ surface = …, cells = … }}",
            health.overfull_faces
        ));
    }
}

/// Loads and displacements far beyond what the size and stiffness of the body suggest.
fn forces(at: &str, spec: &BodySpec, body: &SimBody, doubts: &mut Vec<String>) {
    let area_m2 = body.rest_volume_m3.powf(2.0 / 3.0);
    for (i, load) in spec.loads.iter().enumerate() {
        match load.kind {
            LoadKind::Force { force_n, .. } => {
                let strain = force_n.norm() / (spec.young_pa * area_m2);
                if strain > STRAIN {
                    doubts.push(format!(
                        "{at}.load.{i}.force_n: {:.3e} N would strain a body of this size and stiffness by {} (F / E \
                         A); is it in newtons, and young_pa in pascals?",
                        force_n.norm(),
                        percent(strain)
                    ));
                }
            }
            LoadKind::Pressure { pressure_pa } => {
                let strain = pressure_pa.abs() / spec.young_pa;
                if strain > STRAIN {
                    doubts.push(format!(
                        "{at}.load.{i}.pressure_pa: {pressure_pa:.3e} Pa would strain a body of this stiffness by {} \
                         (p / E); are it and young_pa in pascals?",
                        percent(strain)
                    ));
                }
            }
        }
    }
    let size_m = super::longest_side(body);
    for (i, fix) in spec.fixes.iter().enumerate() {
        if fix.displacement_m.norm() > size_m {
            doubts.push(format!(
                "{at}.fix.{i}.displacement_m: moves a held region by {}, more than the length of the body ({}); \
                is it in metres?",
                length(fix.displacement_m.norm()),
                length(size_m)
            ));
        }
    }
}

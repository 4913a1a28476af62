//! Opens or makes the mesh of a body.

use std::path::Path;

use nalgebra::Vector3;
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};

use crate::mesh_in::{MeshHealth, MeshInError, check_scale, load_surface, load_volume};
use crate::organ::organ;
use crate::scene::{BodySpec, CellSplit, Fault, MeshSource};

/// A mesh and what was found and repaired in its file.
pub struct Opened {
    pub mesh: TetMesh,
    pub health: Option<MeshHealth>,
}

/// Opens or makes a mesh; paths are relative to `base_dir`.
pub fn open(source: &MeshSource, base_dir: &Path) -> Result<Opened, Fault> {
    match source {
        MeshSource::Box { min_m, max_m, cells, split } => {
            Ok(Opened { mesh: box_mesh(*min_m, *max_m, *cells, pattern(*split)?), health: None })
        }
        MeshSource::Grid { lines_m, split } => {
            let cells = [0, 1, 2].map(|axis| lines_m[axis].len() - 1);
            let max = Vector3::from_fn(|axis, _| cells[axis] as f64);
            let mut mesh = box_mesh(Vector3::zeros(), max, cells, pattern(*split)?);
            for node in &mut mesh.nodes {
                *node = Vector3::from_fn(|axis, _| lines_m[axis][node[axis].round() as usize]);
            }
            Ok(Opened { mesh, health: None })
        }
        MeshSource::File { path, scale } => load_volume(&base_dir.join(path), *scale)
            .map(|(mesh, health)| Opened { mesh, health: Some(MeshHealth::Volume(health)) })
            .map_err(fault),
        MeshSource::Surface { path, cells, scale } => load_surface(&base_dir.join(path), *cells, *scale)
            .map(|(mesh, report)| Opened { mesh, health: Some(MeshHealth::Surface(report)) })
            .map_err(fault),
        MeshSource::Organ { cells } => organ(*cells)
            .map(|(mesh, report)| Opened { mesh, health: Some(MeshHealth::Surface(report)) })
            .map_err(fault),
    }
}

/// The pattern of the tetrahedra that a cell is split into.
fn pattern(split: CellSplit) -> Result<BoxPattern, Fault> {
    match split {
        CellSplit::Five => Ok(BoxPattern::Tet5 { parity: false }),
        CellSplit::Six => Ok(BoxPattern::Tet6),
        CellSplit::Octahedral | CellSplit::Hex => Err(Fault::Unsupported {
            found: "this pattern".into(),
            supported: vec!["tet5".into(), "tet6".into()],
        }),
    }
}

fn fault(error: MeshInError) -> Fault {
    match error {
        MeshInError::Io { path, source } => Fault::File {
            path: path.display().to_string(),
            reason: source.to_string(),
            next: "check the path; it is relative to the scene file".into(),
        },
        other => Fault::Mesh { reason: other.to_string() },
    }
}

/// Suspicions about units, each in a sentence: a mesh in millimetres read as metres is a thousand
/// times too large.
pub fn doubts_about_scale(mesh: &TetMesh, spec: &BodySpec) -> Vec<String> {
    let scale = match spec.mesh {
        MeshSource::File { scale, .. } | MeshSource::Surface { scale, .. } => scale,
        MeshSource::Box { .. } | MeshSource::Grid { .. } | MeshSource::Organ { .. } => 1.0,
    };
    let [low, high] = mesh.bounds();
    let warnings = check_scale(&low, &high, scale, spec.density_kg_m3, spec.young_pa);
    warnings.iter().map(|warning| warning.to_string()).collect()
}

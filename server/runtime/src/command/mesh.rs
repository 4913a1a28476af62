//! `scindo mesh` turns a surface or volume file into repaired tetrahedra.

use std::process::ExitCode;

use scindo_program::say;
use scindo_world::mesh_in::{load_any, write_mesh};
use serde_json::json;

use super::cli::MeshArgs;
use super::progress::Share;
use crate::error::RuntimeError;

/// Reads the file, repairs or fills the mesh, and writes it.
pub fn mesh(args: &MeshArgs) -> Result<ExitCode, RuntimeError> {
    if !(args.scale.is_finite() && args.scale > 0.0) {
        return Err(RuntimeError::Option {
            option: "--scale",
            value: args.scale.to_string(),
            reason: "a scale must be positive".to_owned(),
            next: "Use 0.001 for a file in millimetres".to_owned(),
        });
    }
    let extension = args.output.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    if !extension.as_deref().is_some_and(|extension| ["vtu", "vtk", "msh"].contains(&extension)) {
        return Err(RuntimeError::Option {
            option: "--output",
            value: args.output.display().to_string(),
            reason: "the extension of the file determines its format".to_owned(),
            next: "Use .vtu, .vtk or .msh".to_owned(),
        });
    }
    let progress = Share::begin(args.json);
    let (mesh, health) = load_any(&args.input, args.cells as usize, args.scale, &|at| progress.meshing(at))?;
    progress.end();
    write_mesh(&args.output, &mesh, health.groups()).map_err(RuntimeError::Unwritten)?;
    if args.json {
        say!(
            "{:#}",
            json!({
                "output": args.output, "elements": mesh.tets.len(), "nodes": mesh.nodes.len(), "mesh": health,
            })
        );
    } else {
        say!("{health}");
        say!("{}: {} elements, {} nodes", args.output.display(), mesh.tets.len(), mesh.nodes.len());
    }
    Ok(ExitCode::SUCCESS)
}

//! Loads a mesh from a path as tetrahedra, for scenes and `scindo mesh`.

use std::fmt;
use std::path::Path;

use scindo_physics::mesh::TetMesh;
use serde::Serialize;

use super::cubes::OctreeReport;
use super::health::volume::{VolumeHealth, repair_volume};
use super::lattice::{LatticeReport, lattice_observed};
use super::progress::Observer;
use crate::format::{CellGroup, MeshFile, MeshInError, keep_tets, read_mesh};
use crate::quantity::coordinates;

/// Faults found in a mesh file, and their repair. It prints as a few lines of text.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum MeshHealth {
    /// The file held tetrahedra.
    Volume(VolumeHealth),
    /// The file held a surface, filled with a lattice.
    Surface(LatticeReport),
    /// A box or surface was filled with octree cells.
    Octree(OctreeReport),
}

/// Reads a volumetric mesh (`mesh = { file = … }`) and repairs it. `scale` converts its unit to metres.
/// `weld` merges nodes at the same place.
pub fn load_volume(path: &Path, scale: f64, weld: bool) -> Result<(TetMesh, VolumeHealth), MeshInError> {
    match read_mesh(path)? {
        MeshFile::Volume(volume) => repair_volume(&volume, scale, weld),
        MeshFile::Surface(surface) => Err(MeshInError::WrongKind {
            file: surface.file,
            found: "a surface without tetrahedra",
            wanted: "a volume mesh",
            instead: "fill it with a lattice: mesh = { surface = \"…\", cells = 32 }",
        }),
    }
}

/// Reads a surface (`mesh = { surface = …, cells = … }`) and fills it with a lattice.
pub fn load_surface(
    path: &Path,
    cells: usize,
    scale: f64,
    observer: &Observer<'_>,
) -> Result<(TetMesh, LatticeReport), MeshInError> {
    match read_mesh(path)? {
        MeshFile::Surface(surface) => lattice_observed(&surface, cells, scale, observer),
        MeshFile::Volume(volume) => Err(MeshInError::WrongKind {
            file: volume.file,
            found: "tetrahedra",
            wanted: "a surface",
            instead: "use its elements: mesh = { file = \"…\" }",
        }),
    }
}

/// Reads a volume or a surface: tetrahedra are repaired, a surface is filled with `cells` cubes across.
pub fn load_any(
    path: &Path,
    cells: usize,
    scale: f64,
    observer: &Observer<'_>,
) -> Result<(TetMesh, MeshHealth), MeshInError> {
    match read_mesh(path)? {
        MeshFile::Volume(volume) => {
            repair_volume(&volume, scale, true).map(|(mesh, health)| (mesh, MeshHealth::Volume(health)))
        }
        MeshFile::Surface(surface) => lattice_observed(&surface, cells, scale, observer)
            .map(|(mesh, report)| (mesh, MeshHealth::Surface(report))),
    }
}

impl fmt::Display for MeshHealth {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            MeshHealth::Volume(health) => health.fmt(f),
            MeshHealth::Surface(report) => report.fmt(f),
            MeshHealth::Octree(report) => report.fmt(f),
        }
    }
}

impl MeshHealth {
    /// Corners of the box around the file's points [m].
    pub fn corners_m(&self) -> [[f64; 3]; 2] {
        match self {
            MeshHealth::Volume(health) => [health.min_m, health.max_m],
            MeshHealth::Surface(report) => [report.surface.min_m, report.surface.max_m],
            MeshHealth::Octree(report) => [report.min_m, report.max_m],
        }
    }

    /// Groups that the file puts its tetrahedra into.
    pub fn groups(&self) -> &[CellGroup] {
        match self {
            MeshHealth::Volume(health) => &health.groups,
            MeshHealth::Surface(_) | MeshHealth::Octree(_) => &[],
        }
    }

    /// Records that all parts but one were dropped, of whose tetrahedra those in `kept` remain, ascending.
    pub(crate) fn keeps_one_part(&mut self, kept: &[u32]) {
        match self {
            MeshHealth::Volume(health) => {
                health.components = 1;
                keep_tets(&mut health.groups, kept);
            }
            MeshHealth::Surface(report) => {
                report.dropped_components += report.components - 1;
                report.components = 1;
            }
            // An octree keeps all parts.
            MeshHealth::Octree(_) => {}
        }
    }
}

/// "12.3 × 4.5 × 6.7 cm" in the unit that suits the longest side.
fn size(min_m: &[f64; 3], max_m: &[f64; 3]) -> String {
    let side = [0, 1, 2].map(|i| max_m[i] - min_m[i]);
    let longest = side.iter().copied().fold(0.0, f64::max);
    let (unit, factor) = match longest {
        l if l >= 1.0 => ("m", 1.0),
        l if l >= 0.01 => ("cm", 1e2),
        _ => ("mm", 1e3),
    };
    format!("{:.4} × {:.4} × {:.4} {unit}", side[0] * factor, side[1] * factor, side[2] * factor)
}

/// "from [0.0, 0.0, 0.0] to [0.1, 0.05, 0.05] m": where to place cuts and regions.
fn corners(min_m: &[f64; 3], max_m: &[f64; 3]) -> String {
    format!("from {} to {} m", coordinates(min_m), coordinates(max_m))
}

/// Writes "label: a, b, c" from the counts that are not zero.
fn counts(f: &mut fmt::Formatter, label: &str, counts: &[(usize, &str)]) -> fmt::Result {
    let found: Vec<String> =
        counts.iter().filter(|c| c.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
    if found.is_empty() { Ok(()) } else { writeln!(f, "{label}: {}", found.join(", ")) }
}

impl fmt::Display for VolumeHealth {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            f,
            "volume mesh: {} nodes, {} tetrahedra, {}",
            self.nodes,
            self.tets,
            size(&self.min_m, &self.max_m)
        )?;
        writeln!(f, "{}", corners(&self.min_m, &self.max_m))?;
        counts(
            f,
            "repaired",
            &[
                (self.flipped_tets, "inverted tetrahedra reoriented"),
                (self.degenerate_tets, "degenerate tetrahedra removed"),
                (self.duplicate_tets, "duplicate tetrahedra removed"),
                (self.welded_nodes, "duplicate nodes merged"),
                (self.unused_nodes, "unused nodes dropped"),
            ],
        )?;
        counts(
            f,
            "remaining faults",
            &[
                (self.overfull_faces, "faces with more than two tetrahedra"),
                (self.non_manifold_edges, "non-manifold boundary edges"),
                (self.components.saturating_sub(1), "separate parts beside the first"),
            ],
        )?;
        for group in &self.groups {
            let CellGroup { array, number, name, tets } = group;
            let name = name.as_ref().map(|name| format!(" \"{name}\"")).unwrap_or_default();
            writeln!(f, "group {number}{name} of {array}: {} tetrahedra", tets.len())?;
        }
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        write!(
            f,
            "volume {:.4e} m³, smallest dihedral angle {:.1}°, smallest mean ratio {:.3}",
            self.volume_m3, self.min_dihedral_deg, self.min_mean_ratio
        )
    }
}

impl fmt::Display for LatticeReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let s = &self.surface;
        let state = if s.is_clean() { "clean" } else { "dirty" };
        writeln!(
            f,
            "surface: {} triangles in {} components, {state}, {}",
            s.triangles,
            s.components,
            size(&s.min_m, &s.max_m)
        )?;
        writeln!(f, "{}", corners(&s.min_m, &s.max_m))?;
        counts(
            f,
            "repaired",
            &[
                (s.welded_vertices, "duplicate vertices merged"),
                (s.degenerate_triangles, "degenerate triangles removed"),
                (s.duplicate_triangles, "duplicate triangles removed"),
                (s.flipped_triangles, "triangles reoriented"),
                (usize::from(s.was_inside_out), "surface that faced inwards flipped"),
            ],
        )?;
        counts(
            f,
            "bridged",
            &[
                (s.holes, "holes"),
                (s.boundary_edges, "edges with one triangle"),
                (s.non_manifold_edges, "edges with more than two triangles"),
                (s.one_sided_edges, "one-sided edges"),
                (s.self_intersections, "edges that pierce other triangles"),
            ],
        )?;
        writeln!(
            f,
            "lattice: {} cells of {:.3e} m across, {} nodes, {} tetrahedra",
            self.cells, self.spacing_m, self.nodes, self.tets
        )?;
        counts(
            f,
            "changed",
            &[
                (self.hole_crossings, "boundary points across holes"),
                (self.split_nodes, "touching nodes duplicated"),
                (self.removed_tets, "pinching tetrahedra removed"),
                (self.dropped_components, "tiny parts dropped"),
                (self.components.saturating_sub(1), "separate parts beside the first"),
            ],
        )?;
        write!(
            f,
            "volume {:.4e} m³ ({:+.2} % of the surface's), dihedral angles {:.1}° to {:.1}°, smallest mean ratio {:.3}",
            self.volume_m3,
            100.0 * self.volume_error,
            self.min_dihedral_deg,
            self.max_dihedral_deg,
            self.min_mean_ratio
        )
    }
}

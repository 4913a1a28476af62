//! Opens or makes the mesh of a body.

use std::path::Path;

use nalgebra::Vector3;
use scindo_physics::material;
use scindo_physics::mesh::{BoxPattern, HexMesh, TetMesh, box_hexes, box_mesh, graded_hexes};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings, Shape};

use crate::body::region::holds;
use crate::format::{MeshFile, MeshInError, read_mesh};
use crate::mesh_in::{
    MeshHealth, Observer, OctreeReport, SolidSurface, SurfaceHealth, VolumeHealth, body_bytes, check_scale,
    components, fill_observed, load_surface, load_volume, memory_for_meshes,
};
use crate::quantity::memory;
use crate::scene::checked::Region;
use crate::scene::{BodySpec, CellSplit, Fault, MaterialPlace, MaterialSpec, MeshSource, OctreeSpec};

/// The elements of a body.
pub enum Mesh {
    /// Tetrahedra, linear or to be made quadratic.
    Tets(TetMesh),
    /// Hexahedra.
    Hexes(HexMesh),
    /// Cells of an octree.
    Octree(Box<Octree>),
}

impl Mesh {
    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        match self {
            Mesh::Tets(mesh) => mesh.nodes.len(),
            Mesh::Hexes(mesh) => mesh.nodes.len(),
            Mesh::Octree(octree) => octree.n_vertices(),
        }
    }

    /// Corners of the bounding box [m].
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        match self {
            Mesh::Tets(mesh) => mesh.bounds(),
            Mesh::Hexes(mesh) => mesh.nodes.iter().fold(
                [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)],
                |[low, high], x| [low.inf(x), high.sup(x)],
            ),
            Mesh::Octree(octree) => octree.bounds(),
        }
    }

    /// Nodes along the longest way through the mesh.
    pub fn nodes_along(&self) -> f64 {
        let [low, high] = self.bounds();
        let (extent, nodes) = (high - low, self.n_nodes() as f64);
        if let Mesh::Octree(octree) = self {
            return extent.amax() / octree.lattice().h + 1.0;
        }
        let along = extent.amax() * (nodes / extent.product()).cbrt();
        // A flat mesh fills no volume; no way has more nodes than there are.
        if along.is_finite() { along.min(nodes) } else { nodes }
    }
}

/// A mesh and what was found and repaired in its file.
pub struct Opened {
    pub mesh: Mesh,
    pub health: Option<MeshHealth>,
}

impl Opened {
    fn made(mesh: Mesh) -> Self {
        Self { mesh, health: None }
    }

    fn read(mesh: TetMesh, health: MeshHealth) -> Self {
        Self { mesh: Mesh::Tets(mesh), health: Some(health) }
    }
}

/// Opens or makes a mesh; paths are relative to `base_dir`.
pub fn open(source: &MeshSource, base_dir: &Path, observer: &Observer<'_>) -> Result<Opened, Fault> {
    fits(source)?;
    match source {
        MeshSource::Box { min_m, max_m, cells, split } => Ok(Opened::made(match pattern(*split) {
            Some(pattern) => Mesh::Tets(box_mesh(*min_m, *max_m, *cells, pattern)),
            None => Mesh::Hexes(box_hexes(*min_m, *max_m, *cells)),
        })),
        MeshSource::Grid { lines_m, split } => {
            let [x, y, z] = lines_m;
            let hexes = graded_hexes(x, y, z);
            Ok(Opened::made(match pattern(*split) {
                Some(pattern) => Mesh::Tets(split_grid(lines_m, hexes.nodes, pattern)),
                None => Mesh::Hexes(hexes),
            }))
        }
        MeshSource::File { path, scale, weld } => load_volume(&base_dir.join(path), *scale, *weld)
            .map(|(mesh, health)| Opened::read(mesh, MeshHealth::Volume(health)))
            .map_err(fault),
        MeshSource::Surface { path, cells, scale } => {
            load_surface(&base_dir.join(path), *cells, *scale, observer)
                .map(|(mesh, report)| Opened::read(mesh, MeshHealth::Surface(report)))
                .map_err(fault)
        }
        MeshSource::Organ { shape, cells } => shape
            .observed(*cells, observer)
            .map(|(mesh, report)| Opened::read(mesh, MeshHealth::Surface(report)))
            .map_err(fault),
    }
}

/// Fills the mesh of `body` with the cells of `octree`; paths are relative to `base_dir`.
pub fn fill(
    body: &BodySpec,
    octree: OctreeSpec,
    base_dir: &Path,
    observer: &Observer<'_>,
) -> Result<Opened, Fault> {
    let (shape, surface): (Box<dyn Shape>, _) = match &body.mesh {
        MeshSource::Box { min_m, max_m, .. } => (Box::new(BoxShape { min: *min_m, max: *max_m }), None),
        MeshSource::Surface { path, scale, .. } => {
            let (solid, health) = enclosed(path, *scale, base_dir)?;
            (Box::new(solid), Some(health))
        }
        MeshSource::Organ { shape, .. } => {
            let (solid, health) = SolidSurface::new(&shape.surface(), 1.0).map_err(fault)?;
            (Box::new(solid), Some(health))
        }
        MeshSource::File { .. } | MeshSource::Grid { .. } => {
            return Err(Fault::Mesh { reason: "octree cells fill a box, a surface or an organ".into() });
        }
    };
    let bounds = shape.bounds();
    let regions = body.materials.iter().map(|material| -> Result<Box<dyn Shape>, Fault> {
        Ok(match &material.place {
            MaterialPlace::Region(region) => Box::new(RegionShape { region: region.clone(), bounds }),
            MaterialPlace::Surface { path, scale } => Box::new(enclosed(path, *scale, base_dir)?.0),
        })
    });
    let regions: Vec<Box<dyn Shape>> = regions.collect::<Result<_, _>>()?;
    let regions: Vec<&dyn Shape> = regions.iter().map(|region| &**region).collect();
    let settings = OctreeSettings { cells: octree.cells, levels: octree.levels };
    let (mut octree, report) = fill_observed(&*shape, settings, &regions, observer)
        .map_err(|error| Fault::Mesh { reason: error.to_string() })?;
    let constants = body.materials.iter().map(|material| {
        let MaterialSpec { young_pa, poisson, density_kg_m3, .. } = *material;
        material::Region { young_pa, poisson, density_kg_m3 }
    });
    octree.set_regions(constants.collect());
    let health = MeshHealth::Octree(OctreeReport { surface, ..report });
    Ok(Opened { mesh: Mesh::Octree(Box::new(octree)), health: Some(health) })
}

/// The solid inside a surface file.
fn enclosed(path: &str, scale: f64, base_dir: &Path) -> Result<(SolidSurface, SurfaceHealth), Fault> {
    match read_mesh(&base_dir.join(path)).map_err(fault)? {
        MeshFile::Surface(surface) => SolidSurface::new(&surface, scale).map_err(fault),
        MeshFile::Volume(volume) => Err(Fault::Mesh {
            reason: format!(
                "{} holds tetrahedra; octree cells fill a surface: .obj, .stl or .ply",
                volume.file
            ),
        }),
    }
}

/// A region of a body between the corners `bounds` [m]. Only its inside is asked for.
struct RegionShape {
    region: Region,
    bounds: [Vector3<f64>; 2],
}

impl Shape for RegionShape {
    fn bounds(&self) -> [Vector3<f64>; 2] {
        self.bounds
    }

    fn contains(&self, p: &Vector3<f64>) -> bool {
        holds(&self.region, self.bounds, p)
    }

    fn crossing(&self, _: &Vector3<f64>, _: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        None
    }
}

/// Refuses a block that would not fit into the memory of this machine.
fn fits(source: &MeshSource) -> Result<(), Fault> {
    let cells = match source {
        MeshSource::Box { cells, .. } => cells.map(|n| n as f64),
        MeshSource::Grid { lines_m, .. } => [0, 1, 2].map(|axis| (lines_m[axis].len() - 1) as f64),
        _ => return Ok(()),
    };
    let per_cell = if source.split() == Some(CellSplit::Five) { 5.0 } else { 6.0 };
    let (needed, free) = (body_bytes(per_cell * cells.iter().product::<f64>()), memory_for_meshes());
    if needed <= free {
        return Ok(());
    }
    let shrink = (free / needed).cbrt();
    let most = cells.map(|n| (n * shrink).floor().max(1.0) as u32);
    Err(Fault::Conflict {
        what: format!(
            "found {cells:?} cells, which need about {}; {} may be used here",
            memory(needed),
            memory(free)
        ),
        next: format!("use {most:?} cells at most"),
    })
}

/// Leaves only the part of the largest volume.
pub fn keep_largest_part(mesh: &mut TetMesh) -> bool {
    let (part, count) = components(mesh);
    let mut volumes = vec![0.0; count];
    (0..mesh.tets.len()).for_each(|e| volumes[part[e] as usize] += mesh.volume(e));
    let largest = (0..count).max_by(|&a, &b| volumes[a].total_cmp(&volumes[b]));
    let mut parts = part.iter();
    mesh.tets.retain(|_| parts.next().map(|&part| part as usize) == largest);
    mesh.drop_unused_nodes();
    count > 1
}

/// The tetrahedra that a cell is split into; none: it stays a hexahedron.
fn pattern(split: CellSplit) -> Option<BoxPattern> {
    match split {
        CellSplit::Five => Some(BoxPattern::Tet5 { parity: false }),
        CellSplit::Six => Some(BoxPattern::Tet6),
        CellSplit::Octahedral => Some(BoxPattern::Octahedral6),
        CellSplit::Hex => None,
    }
}

/// A box of as many cells as the grid has, with the grid's nodes, which are numbered alike.
fn split_grid(lines_m: &[Vec<f64>; 3], nodes: Vec<Vector3<f64>>, pattern: BoxPattern) -> TetMesh {
    let cells = [0, 1, 2].map(|axis| lines_m[axis].len() - 1);
    let unit = Vector3::from_fn(|axis, _| cells[axis] as f64);
    TetMesh { nodes, ..box_mesh(Vector3::zeros(), unit, cells, pattern) }
}

pub(super) fn fault(error: MeshInError) -> Fault {
    match error {
        MeshInError::Io { path, source } => Fault::File {
            path: path.display().to_string(),
            reason: source.to_string(),
            next: "check the path; it is relative to the scene file".into(),
        },
        other => Fault::Mesh { reason: other.to_string() },
    }
}

/// What reading a mesh file has changed that may have been meant otherwise.
pub fn doubts_about_repair(health: Option<&MeshHealth>) -> Option<String> {
    let Some(MeshHealth::Volume(VolumeHealth { welded_nodes: joined, .. })) = health else { return None };
    (*joined > 0).then(|| {
        format!(
            "{joined} nodes of the file coincide with another node and were merged with it; this closes a cut or \
             gap there. Write weld = false to keep them apart"
        )
    })
}

/// Suspicions about units, each in a sentence: a mesh in millimetres read as metres is a thousand
/// times too large.
pub fn doubts_about_scale([low, high]: [Vector3<f64>; 2], spec: &BodySpec) -> Vec<String> {
    let scale = match spec.mesh {
        MeshSource::File { scale, .. } | MeshSource::Surface { scale, .. } => scale,
        MeshSource::Box { .. } | MeshSource::Grid { .. } | MeshSource::Organ { .. } => 1.0,
    };
    let warnings = check_scale(&low, &high, scale, spec.density_kg_m3, spec.young_pa);
    warnings.iter().map(|warning| warning.to_string()).collect()
}

//! Opens or makes the mesh of a body.

use std::path::Path;

use nalgebra::Vector3;
use scindo_physics::material::{self, Regions};
use scindo_physics::mesh::{BoxPattern, HexMesh, TetMesh, box_hexes, box_mesh, graded_hexes};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings, Shape};

use crate::body::region::holds;
use crate::format::{CellGroup, MeshFile, MeshInError, read_mesh};
use crate::mesh_in::{
    MeshHealth, Observer, OctreeReport, SolidSurface, SurfaceHealth, VolumeHealth, body_bytes, check_scale,
    components, fill_observed, load_surface, load_volume, memory_for_meshes,
};
use crate::quantity::memory;
use crate::scene::checked::Region;
use crate::scene::{BodySpec, CellSplit, Fault, MaterialPlace, MaterialSpec, MeshSource, OctreeSpec};

/// The elements of a body.
pub(crate) enum Mesh {
    /// Tetrahedra, linear or to be made quadratic.
    Tets(TetMesh),
    /// Hexahedra.
    Hexes(HexMesh),
    /// Cells of an octree.
    Octree(Box<Octree>),
}

impl Mesh {
    /// Number of nodes.
    pub(crate) fn n_nodes(&self) -> usize {
        match self {
            Mesh::Tets(mesh) => mesh.nodes.len(),
            Mesh::Hexes(mesh) => mesh.nodes.len(),
            Mesh::Octree(octree) => octree.n_vertices(),
        }
    }

    /// Centres of the tetrahedra or hexahedra [m]; cells of an octree have their materials already.
    pub(crate) fn centres(&self) -> Vec<Vector3<f64>> {
        match self {
            Mesh::Tets(mesh) => {
                let centre = |e: usize| mesh.corners(e).iter().sum::<Vector3<f64>>() / 4.0;
                (0..mesh.tets.len()).map(centre).collect()
            }
            Mesh::Hexes(mesh) => {
                let centre = |e: usize| mesh.corners(e).iter().sum::<Vector3<f64>>() / 8.0;
                (0..mesh.hexes.len()).map(centre).collect()
            }
            Mesh::Octree(_) => Vec::new(),
        }
    }

    /// Corners of the bounding box [m].
    pub(crate) fn bounds(&self) -> [Vector3<f64>; 2] {
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
    pub(crate) fn nodes_along(&self) -> f64 {
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
pub(crate) struct Opened {
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
pub(crate) fn open(source: &MeshSource, base_dir: &Path, observer: &Observer<'_>) -> Result<Opened, Fault> {
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
pub(crate) fn fill(
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
    let regions = body.materials.iter().map(|material| match &material.place {
        MaterialPlace::Region(region) => Ok(in_region(region, bounds)),
        MaterialPlace::Surface { path, scale } => inside(path, *scale, base_dir),
        MaterialPlace::Group { .. } => {
            Err(Fault::Mesh { reason: "octree cells have no groups from a file".into() })
        }
    });
    let regions: Vec<Box<dyn Shape>> = regions.collect::<Result<_, _>>()?;
    let regions: Vec<&dyn Shape> = regions.iter().map(|region| &**region).collect();
    let settings = OctreeSettings { cells: octree.cells, levels: octree.levels };
    let (mut octree, report) = fill_observed(&*shape, settings, &regions, observer)
        .map_err(|error| Fault::Mesh { reason: error.to_string() })?;
    octree.set_regions(body.materials.iter().map(constants).collect());
    let health = MeshHealth::Octree(OctreeReport { surface, ..report });
    Ok(Opened { mesh: Mesh::Octree(Box::new(octree)), health: Some(health) })
}

/// The regions of other materials in a mesh of tetrahedra or hexahedra: the last one that holds the centre of an
/// element, or whose group it belongs to, counts. Paths are relative to `base_dir`. The fault comes with the number of
/// its region.
pub(crate) fn regions(
    body: &BodySpec,
    centres: &[Vector3<f64>],
    groups: &[CellGroup],
    bounds: [Vector3<f64>; 2],
    base_dir: &Path,
) -> Result<Regions, (usize, Fault)> {
    let mut of_element = vec![0; centres.len()];
    for (i, material) in body.materials.iter().enumerate() {
        let region = i as u16 + 1;
        let shape = match &material.place {
            MaterialPlace::Region(region) => in_region(region, bounds),
            MaterialPlace::Surface { path, scale } => {
                inside(path, *scale, base_dir).map_err(|fault| (i, fault))?
            }
            MaterialPlace::Group { group, array } => {
                let found = group_named(groups, group, array.as_deref()).map_err(|fault| (i, fault))?;
                found.tets.iter().for_each(|&tet| of_element[tet as usize] = region);
                continue;
            }
        };
        for (of_element, centre) in of_element.iter_mut().zip(centres) {
            if shape.contains(centre) {
                *of_element = region;
            }
        }
    }
    let constants = body.materials.iter().map(constants).collect();
    Regions::new(constants, of_element).map_err(|error| (0, Fault::Mesh { reason: error.to_string() }))
}

/// The group of this name or number.
fn group_named<'a>(
    groups: &'a [CellGroup],
    wanted: &str,
    array: Option<&str>,
) -> Result<&'a CellGroup, Fault> {
    // A name that looks like a number counts as a name where there is one.
    let is_name = groups.iter().any(|group| group.name.as_deref() == Some(wanted));
    let number = wanted.parse().ok().filter(|_: &i64| !is_name);
    let is_wanted = |group: &&CellGroup| match number {
        Some(number) => group.number == number,
        None => group.name.as_deref() == Some(wanted),
    };
    let of_array = |group: &&CellGroup| array.is_none_or(|array| group.array == array);
    let mut found = groups.iter().filter(is_wanted).filter(of_array);
    match (found.next(), found.next()) {
        (Some(group), None) => Ok(group),
        (Some(first), Some(second)) => Err(Fault::Conflict {
            what: format!("found group \"{wanted}\" in the arrays {} and {}", first.array, second.array),
            next: format!("write array = \"{}\" or \"{}\" beside it", first.array, second.array),
        }),
        (None, _) => Err(Fault::Conflict {
            what: format!("found group \"{wanted}\", allowed here: {}", list(groups)),
            next: "name one of them".into(),
        }),
    }
}

/// The groups of a file in a sentence.
fn list(groups: &[CellGroup]) -> String {
    const SHOWN: usize = 12;
    if groups.is_empty() {
        return "none, because the file has no groups of tetrahedra".into();
    }
    let one = |group: &CellGroup| match &group.name {
        Some(name) => format!("\"{name}\""),
        None => format!("\"{}\" ({})", group.number, group.array),
    };
    let mut shown: Vec<String> = groups.iter().take(SHOWN).map(one).collect();
    if groups.len() > SHOWN {
        shown.push(format!("{} more", groups.len() - SHOWN));
    }
    shown.join(", ")
}

/// Constants of a region.
fn constants(material: &MaterialSpec) -> material::Region {
    let MaterialSpec { young_pa, poisson, density_kg_m3, .. } = *material;
    material::Region { young_pa, poisson, density_kg_m3 }
}

fn in_region(region: &Region, bounds: [Vector3<f64>; 2]) -> Box<dyn Shape> {
    Box::new(RegionShape { region: region.clone(), bounds })
}

fn inside(path: &str, scale: f64, base_dir: &Path) -> Result<Box<dyn Shape>, Fault> {
    Ok(Box::new(enclosed(path, scale, base_dir)?.0))
}

/// The solid inside a surface file.
fn enclosed(path: &str, scale: f64, base_dir: &Path) -> Result<(SolidSurface, SurfaceHealth), Fault> {
    match read_mesh(&base_dir.join(path)).map_err(fault)? {
        MeshFile::Surface(surface) => SolidSurface::new(&surface, scale).map_err(fault),
        MeshFile::Volume(volume) => Err(Fault::Mesh {
            reason: format!(
                "{} holds tetrahedra; a closed surface is needed here: .obj, .stl or .ply",
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

/// Leaves only the part of the largest volume. The tetrahedra that remain, if there was another part.
pub(crate) fn keep_largest_part(mesh: &mut TetMesh) -> Option<Vec<u32>> {
    let (part, count) = components(mesh);
    let mut volumes = vec![0.0; count];
    (0..mesh.tets.len()).for_each(|e| volumes[part[e] as usize] += mesh.volume(e));
    let largest = (0..count).max_by(|&a, &b| volumes[a].total_cmp(&volumes[b]));
    let inside = |e: &u32| Some(part[*e as usize] as usize) == largest;
    let kept: Vec<u32> = (0..mesh.tets.len() as u32).filter(inside).collect();
    mesh.tets = kept.iter().map(|&e| mesh.tets[e as usize]).collect();
    mesh.drop_unused_nodes();
    (count > 1).then_some(kept)
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
pub(crate) fn doubts_about_repair(health: Option<&MeshHealth>) -> Option<String> {
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
pub(crate) fn doubts_about_scale([low, high]: [Vector3<f64>; 2], spec: &BodySpec) -> Vec<String> {
    let scale = match spec.mesh {
        MeshSource::File { scale, .. } | MeshSource::Surface { scale, .. } => scale,
        MeshSource::Box { .. } | MeshSource::Grid { .. } | MeshSource::Organ { .. } => 1.0,
    };
    let warnings = check_scale(&low, &high, scale, spec.density_kg_m3, spec.young_pa);
    warnings.iter().map(|warning| warning.to_string()).collect()
}

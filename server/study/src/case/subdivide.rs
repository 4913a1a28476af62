//! Refines volumetric mesh files. Every tetrahedron is split into eight at the midpoints of its edges.
//!
//! The boundary stays the polyhedron of the file, so that all levels fill the same body. The four corner
//! tetrahedra are similar to the whole. The octahedron between them is split at its shortest diagonal. This
//! keeps the worst angle bounded over any number of levels (Bey, Computing 55 (1995), 355–378).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use scindo_physics::mesh::TetMesh;
use scindo_world::mesh_in::{load_volume, write_mesh};
use scindo_world::scene::{CheckedScene, MeshSource};

/// A level is made up to this number of elements.
const MOST_TETS: usize = 400_000;

/// A refined copy of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Level {
    /// Ratio of the file's edge length to the edge length of this copy.
    pub factor: f64,
    /// Number of elements.
    pub tets: usize,
    /// Path of the copy; `None` for the scene's own file.
    path: Option<PathBuf>,
}

impl Level {
    /// Overrides that use the copy in the scene.
    pub(super) fn overrides(&self, body: &str) -> Vec<String> {
        let Some(path) = &self.path else { return Vec::new() };
        let path = path.display();
        let mesh = |key: &str, value: &str| format!("body.{body}.mesh.{key}={value}");
        // Coincident nodes are the two lips of a cut, unless the scene's own file was already welded.
        vec![mesh("file", &format!("\"{path}\"")), mesh("scale", "1.0"), mesh("weld", "false")]
    }
}

/// Refined copies of the mesh files of a scene, per body.
#[derive(Debug, Clone, Default)]
pub(super) struct Subdivisions {
    bodies: BTreeMap<usize, Vec<Level>>,
}

impl Subdivisions {
    /// Writes refined copies of the files of a scene into `directory`, which is created if missing. An
    /// unreadable file is skipped here; the run that needs it reports the error.
    ///
    /// # Errors
    /// The directory or a file in it cannot be written.
    pub(super) fn write(scene: &CheckedScene, base_dir: &Path, directory: &Path) -> Result<Self, String> {
        let mut bodies = BTreeMap::new();
        for (i, body) in scene.bodies.iter().enumerate() {
            let MeshSource::File { path, scale, weld } = &body.mesh else { continue };
            let Ok((mut mesh, health)) = load_volume(&base_dir.join(path), *scale, *weld) else { continue };
            let mut levels = vec![Level { factor: 1.0, tets: mesh.tets.len(), path: None }];
            let mut factor = 2.0;
            let mut groups = health.groups;
            // Only files of Gmsh keep names.
            let format = if groups.iter().any(|group| group.name.is_some()) { "msh" } else { "vtu" };
            while 8 * mesh.tets.len() <= MOST_TETS && factor <= 4.0 {
                mesh = split(&mesh);
                groups.iter_mut().for_each(|group| group.tets = parts_of(&group.tets));
                std::fs::create_dir_all(directory).map_err(|e| format!("{}: {e}", directory.display()))?;
                let whole = std::path::absolute(directory).map_err(|e| e.to_string())?;
                let path = whole.join(format!("{}-x{factor}.{format}", body.id));
                write_mesh(&path, &mesh, &groups).map_err(|error| error.to_string())?;
                levels.push(Level { factor, tets: mesh.tets.len(), path: Some(path) });
                factor *= 2.0;
            }
            bodies.insert(i, levels);
        }
        Ok(Self { bodies })
    }

    /// The copy whose edges are `factor` times finer, to within a quarter; `None` if there is none.
    pub(super) fn level(&self, body: usize, factor: f64) -> Option<&Level> {
        self.bodies.get(&body)?.iter().find(|level| (level.factor / factor).ln().abs() < 0.22)
    }
}

/// Numbers of the parts that [`split`] makes of these tetrahedra.
fn parts_of(tets: &[u32]) -> Vec<u32> {
    tets.iter().flat_map(|tet| 8 * tet..8 * tet + 8).collect()
}

/// Splits every tetrahedron into eight, which follow each other.
pub(super) fn split(mesh: &TetMesh) -> TetMesh {
    let mut nodes = mesh.nodes.clone();
    let mut middles = BTreeMap::new();
    let mut tets = Vec::with_capacity(8 * mesh.tets.len());
    for corners in &mesh.tets {
        let [a, b, c, d] = *corners;
        let mut middle = |i: u32, j: u32| {
            *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                nodes.push(0.5 * (mesh.nodes[i as usize] + mesh.nodes[j as usize]));
                nodes.len() as u32 - 1
            })
        };
        let (ab, ac, ad) = (middle(a, b), middle(a, c), middle(a, d));
        let (bc, bd, cd) = (middle(b, c), middle(b, d), middle(c, d));
        tets.extend([[a, ab, ac, ad], [ab, b, bc, bd], [ac, bc, c, cd], [ad, bd, cd, d]]);
        // Four tets share a diagonal of the octahedron, and the other four corners form a ring around it.
        let diagonals =
            [([ab, cd], [ac, bc, bd, ad]), ([ac, bd], [ab, ad, cd, bc]), ([ad, bc], [ab, bd, cd, ac])];
        let length = |ends: &[u32; 2]| (nodes[ends[0] as usize] - nodes[ends[1] as usize]).norm_squared();
        let shortest = diagonals.iter().min_by(|x, y| length(&x.0).total_cmp(&length(&y.0)));
        if let Some(([p, q], ring)) = shortest {
            for i in 0..4 {
                tets.push(upright(&nodes, [*p, *q, ring[i], ring[(i + 1) % 4]]));
            }
        }
    }
    TetMesh { nodes, tets }
}

/// The tetrahedron on these nodes, ordered to have positive volume.
fn upright(nodes: &[Vector3<f64>], [a, b, c, d]: [u32; 4]) -> [u32; 4] {
    let [w, x, y, z] = [a, b, c, d].map(|n| nodes[n as usize]);
    if (x - w).cross(&(y - w)).dot(&(z - w)) > 0.0 { [a, b, c, d] } else { [a, b, d, c] }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use scindo_physics::mesh::{BoxPattern, box_mesh};

    #[test]
    fn eight_parts_fill_each_tetrahedron() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::new(1.0, 2.0, 3.0), [2, 2, 2], BoxPattern::Tet6);
        let fine = split(&split(&mesh));
        assert_eq!(fine.tets.len(), 64 * mesh.tets.len());
        fine.check().unwrap();
        let volume: f64 = (0..fine.tets.len()).map(|e| fine.volume(e)).sum();
        assert!((volume - 6.0).abs() < 1e-12, "{volume}");
        // As many nodes as in a block with four times the cells: midpoints are shared.
        let same = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [8, 8, 8], BoxPattern::Tet6);
        assert_eq!(fine.nodes.len(), same.nodes.len());
    }
}

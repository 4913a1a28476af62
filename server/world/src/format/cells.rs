//! Gathers the cells of a file: tetrahedra make a volume mesh, faces a surface.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::error::MeshInError;
use super::groups::Labels;
use super::mesh_file::{MeshFile, SurfaceMesh, VolumeMesh};

/// Contribution of a cell of a file to the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CellKind {
    /// The first four nodes are the corners of a tetrahedron; `order` > 1 has more nodes after them.
    Tetrahedron {
        /// Polynomial order of the element in the file.
        order: u8,
    },
    /// The first three nodes are the corners of a triangle.
    Triangle,
    /// The first four nodes go round a quadrilateral.
    Quad,
    /// All nodes go round a polygon.
    Polygon,
    /// Each three successive nodes make a triangle, with alternating winding.
    Strip,
    /// Two nodes 0,3 and 1,2 in VTK's pixel order 0-1-3-2.
    Pixel,
    /// Points and lines: counted, not used.
    Ignored(&'static str),
    /// Volume cells this program does not read.
    Refused(&'static str),
}

/// The cells of one file, gathered while reading.
#[derive(Default)]
pub(super) struct CellSoup {
    tets: Vec<[i64; 4]>,
    triangles: Vec<[i64; 3]>,
    /// Number of cells so far.
    cells: u32,
    /// Cell of every tetrahedron.
    cell_of_tet: Vec<u32>,
    labels: Vec<Labels>,
    ignored: BTreeMap<&'static str, usize>,
    high_order: usize,
}

impl CellSoup {
    /// Adds one cell. Returns `false` if its node count does not fit its kind. The caller must not add
    /// refused kinds.
    #[must_use]
    pub(super) fn add(&mut self, kind: CellKind, nodes: &[i64]) -> bool {
        self.cells += 1;
        match (kind, nodes) {
            (CellKind::Tetrahedron { order }, &[a, b, c, d, ..]) => {
                self.tets.push([a, b, c, d]);
                self.cell_of_tet.push(self.cells - 1);
                self.high_order += usize::from(order > 1);
            }
            (CellKind::Triangle, &[a, b, c, ..]) => self.triangles.push([a, b, c]),
            (CellKind::Quad, &[a, b, c, d, ..]) => self.triangles.extend([[a, b, c], [a, c, d]]),
            (CellKind::Pixel, &[a, b, c, d, ..]) => self.triangles.extend([[a, b, d], [a, d, c]]),
            (CellKind::Polygon, &[first, ref rest @ ..]) if rest.len() >= 2 => {
                self.triangles.extend(rest.windows(2).map(|pair| [first, pair[0], pair[1]]));
            }
            (CellKind::Strip, strip) if strip.len() >= 3 => {
                self.triangles.extend(
                    strip
                        .windows(3)
                        .enumerate()
                        .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }),
                );
            }
            (CellKind::Ignored(name), _) => *self.ignored.entry(name).or_default() += 1,
            _ => return false,
        }
        true
    }

    /// Number of cells so far, used or not.
    pub(super) fn count(&self) -> u32 {
        self.cells
    }

    /// Adds values of cells; those of an array that is known already are joined to it.
    pub(super) fn label(&mut self, labels: Labels) {
        match self.labels.iter_mut().find(|known| known.array == labels.array) {
            Some(known) => known.values.extend(labels.values),
            None => self.labels.push(labels),
        }
    }

    /// Shifts the node indices of everything added since `mark` by `first_node`, for files in several pieces.
    pub(super) fn shift_since(&mut self, mark: (usize, usize), first_node: i64) {
        self.tets[mark.0..].iter_mut().flatten().for_each(|n| *n += first_node);
        self.triangles[mark.1..].iter_mut().flatten().for_each(|n| *n += first_node);
    }

    /// Numbers of tetrahedra and triangles so far.
    pub(super) fn mark(&self) -> (usize, usize) {
        (self.tets.len(), self.triangles.len())
    }

    /// Maps the file's node tags to indices with `index_of` and makes the mesh: a volume if there is any
    /// tetrahedron, otherwise a surface.
    pub(super) fn finish(
        self,
        file: &str,
        nodes: Vec<Vector3<f64>>,
        index_of: impl Fn(i64) -> Option<u32>,
    ) -> Result<MeshFile, MeshInError> {
        let n_nodes = nodes.len();
        let missing = |element, number, node| MeshInError::NodeIndex {
            file: file.into(),
            element,
            number,
            node,
            n_nodes,
        };
        let mut notes: Vec<String> = Vec::new();
        for (name, count) in &self.ignored {
            notes.push(format!("{count} {name} cells not used"));
        }
        if self.high_order > 0 {
            notes.push(format!(
                "{} tetrahedra of higher order: corner nodes used, edges straight",
                self.high_order
            ));
        }
        if !self.tets.is_empty() {
            if !self.triangles.is_empty() {
                notes.push(format!("{} faces beside the tetrahedra not used", self.triangles.len()));
            }
            let tets = corners(&self.tets, index_of).map_err(|(i, n)| missing("tetrahedron", i, n))?;
            let groups = self.labels.into_iter().flat_map(|labels| labels.groups(&self.cell_of_tet));
            let groups = groups.collect();
            return Ok(MeshFile::Volume(VolumeMesh { file: file.into(), nodes, tets, groups, notes }));
        }
        if self.triangles.is_empty() {
            return Err(MeshInError::Empty { file: file.into(), n_nodes });
        }
        let triangles = corners(&self.triangles, index_of).map_err(|(i, n)| missing("triangle", i, n))?;
        Ok(MeshFile::Surface(SurfaceMesh { file: file.into(), vertices: nodes, triangles, notes }))
    }
}

/// Index lookup for a file that counts its nodes from zero.
pub(super) fn zero_based(n_nodes: usize) -> impl Fn(i64) -> Option<u32> {
    move |node| u32::try_from(node).ok().filter(|&n| (n as usize) < n_nodes)
}

/// Converts the tags of all cells to indices. The error names the cell and the tag without a node.
fn corners<const N: usize>(
    cells: &[[i64; N]],
    index_of: impl Fn(i64) -> Option<u32>,
) -> Result<Vec<[u32; N]>, (usize, i64)> {
    let mut mapped = Vec::with_capacity(cells.len());
    for (number, cell) in cells.iter().enumerate() {
        let mut indices = [0; N];
        for (slot, &tag) in indices.iter_mut().zip(cell) {
            *slot = index_of(tag).ok_or((number, tag))?;
        }
        mapped.push(indices);
    }
    Ok(mapped)
}

//! Structured tet meshes of an axis-parallel box.

use nalgebra::Vector3;

use super::{TetMesh, tet_volume};

/// How a box cell is split into tetrahedra. Both patterns match across cell faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoxPattern {
    /// Five tets per cell, one in the middle and four at corners, mirrored in a checkerboard.
    Tet5 {
        /// `false`: the cell (0,0,0) cuts off corners 1, 2, 4, 7; `true`: 0, 3, 5, 6.
        parity: bool,
    },
    /// Six tets around the cell diagonal 0–7 (Kuhn/Freudenthal), the same in every cell.
    Tet6,
    /// Two tets at opposite corners 0 and 7 and four around the diagonal 3–4 of the octahedron
    /// between them, the same in every cell (Nienhuys 2003, *Cutting in deformable objects*, §3.3).
    Octahedral6,
}

/// Cell corner c = a + 2 b + 4 d with a, b, d ∈ {0, 1} along x, y, z.
const TET5_EVEN: [[usize; 4]; 5] = [[0, 3, 5, 6], [1, 0, 3, 5], [2, 0, 6, 3], [4, 0, 5, 6], [7, 3, 6, 5]];
const TET5_ODD: [[usize; 4]; 5] = [[1, 2, 4, 7], [0, 1, 2, 4], [3, 1, 7, 2], [5, 1, 4, 7], [6, 2, 7, 4]];
const TET6: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];
/// The ring around the diagonal 3–4 is 1, 2, 6, 5 in the order of neighbours 1–2–6–5.
const OCTAHEDRAL6: [[usize; 4]; 6] =
    [[0, 1, 2, 4], [7, 6, 5, 3], [4, 3, 1, 2], [4, 3, 2, 6], [4, 3, 6, 5], [4, 3, 5, 1]];

/// Meshes the box from `min` to `max` [m] with `cells` cells along x, y, z.
///
/// Node id = i + (nx+1)·(j + (ny+1)·k); tets in cell order, x fastest. An empty or flat box gives
/// a mesh that [`TetMesh::check`] refuses.
///
/// ```
/// use nalgebra::Vector3;
/// use scindo_matter::mesh::{BoxPattern, box_mesh};
///
/// let size = Vector3::new(0.3, 0.1, 0.1); // m
/// let mesh = box_mesh(Vector3::zeros(), size, [6, 2, 2], BoxPattern::Tet6);
/// assert_eq!((mesh.nodes.len(), mesh.tets.len()), (7 * 3 * 3, 6 * 6 * 2 * 2));
/// assert!((mesh.volumes().iter().sum::<f64>() - 0.003).abs() < 1e-15); // m³
/// ```
pub fn box_mesh(min: Vector3<f64>, max: Vector3<f64>, cells: [usize; 3], pattern: BoxPattern) -> TetMesh {
    let [nx, ny, nz] = cells;
    let node = |i: usize, j: usize, k: usize| i + (nx + 1) * (j + (ny + 1) * k);
    let mut mesh = TetMesh::default();
    if nx * ny * nz == 0 {
        return mesh;
    }
    mesh.nodes.reserve((nx + 1) * (ny + 1) * (nz + 1));
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                let s = Vector3::new(i as f64 / nx as f64, j as f64 / ny as f64, k as f64 / nz as f64);
                mesh.nodes.push(min + (max - min).component_mul(&s));
            }
        }
    }
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let corner = |c: usize| node(i + (c & 1), j + ((c >> 1) & 1), k + ((c >> 2) & 1)) as u32;
                split_cell(&mesh.nodes, corner, split(pattern, (i + j + k) % 2 == 1), &mut mesh.tets);
            }
        }
    }
    mesh
}

/// Splits cells with eight corners each into six tets around their diagonals 0–7.
pub(super) fn split_cells(nodes: &[Vector3<f64>], cells: &[[u32; 8]]) -> Vec<[u32; 4]> {
    let mut tets = Vec::new();
    for cell in cells {
        split_cell(nodes, |c| cell[c], &TET6, &mut tets);
    }
    tets
}

fn split_cell(
    nodes: &[Vector3<f64>],
    corner: impl Fn(usize) -> u32,
    split: &[[usize; 4]],
    tets: &mut Vec<[u32; 4]>,
) {
    for tet in split {
        let mut ids = tet.map(&corner);
        if tet_volume(&ids.map(|n| nodes[n as usize])) < 0.0 {
            ids.swap(2, 3);
        }
        tets.push(ids);
    }
}

fn split(pattern: BoxPattern, odd_cell: bool) -> &'static [[usize; 4]] {
    match pattern {
        BoxPattern::Tet5 { parity } if parity == odd_cell => &TET5_EVEN,
        BoxPattern::Tet5 { .. } => &TET5_ODD,
        BoxPattern::Tet6 => &TET6,
        BoxPattern::Octahedral6 => &OCTAHEDRAL6,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn bar(pattern: BoxPattern) -> TetMesh {
        box_mesh(Vector3::zeros(), Vector3::new(1.0, 0.2, 0.2), [40, 8, 8], pattern)
    }

    #[test]
    fn every_pattern_fills_the_box_with_matching_faces() {
        for pattern in [
            BoxPattern::Tet5 { parity: false },
            BoxPattern::Tet5 { parity: true },
            BoxPattern::Tet6,
            BoxPattern::Octahedral6,
        ] {
            let mesh = bar(pattern);
            mesh.check().unwrap();
            assert!((mesh.volumes().iter().sum::<f64>() - 0.04).abs() < 1e-13);
            let skin = mesh.boundary_faces();
            assert_eq!(skin.len(), 2 * 2 * (40 * 8 * 2 + 8 * 8), "{pattern:?}");
        }
    }

    #[test]
    fn counts_of_the_reference_problems() {
        let tet5 = bar(BoxPattern::Tet5 { parity: false });
        assert_eq!((tet5.nodes.len(), tet5.tets.len()), (3_321, 12_800));
        let cube = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [11; 3], BoxPattern::Tet6);
        assert_eq!((cube.nodes.len(), cube.tets.len()), (1_728, 7_986));
    }

    /// The first cells of the published 41×9×9 mesh, and a checksum over the whole of it.
    #[test]
    fn numbering_of_the_drooping_bar_reference() {
        let mesh = bar(BoxPattern::Tet5 { parity: false });
        let first = [[0, 42, 410, 370], [1, 0, 370, 42], [41, 0, 42, 410], [369, 0, 410, 370]];
        assert_eq!(mesh.tets[..4], first);
        assert_eq!(checksum(&mesh), REFERENCE_CHECKSUM);
    }

    /// FNV-1a over the node ids in file order.
    fn checksum(mesh: &TetMesh) -> u64 {
        mesh.tets
            .iter()
            .flatten()
            .fold(0xcbf2_9ce4_8422_2325, |h, &n| (h ^ u64::from(n)).wrapping_mul(0x0000_0100_0000_01b3))
    }

    const REFERENCE_CHECKSUM: u64 = 0x81dc_b64e_9084_6385;

    #[test]
    fn an_empty_or_flat_box_is_refused_by_check() {
        let flat = box_mesh(Vector3::zeros(), Vector3::new(1.0, 1.0, 0.0), [1; 3], BoxPattern::Tet6);
        assert!(flat.check().is_err());
        let none = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [1, 0, 1], BoxPattern::Tet6);
        assert!(none.check().is_err());
    }
}

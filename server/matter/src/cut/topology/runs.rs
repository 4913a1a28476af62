//! Runs of consecutive elements and their nodes. Where all nodes of a run are out of reach, none of its
//! elements has to be examined.

use crate::mesh::TetMesh;

/// Elements per run. Neighbours mostly have close numbers, so a run has far fewer nodes than element corners.
const ELEMENTS: usize = 64;

/// The nodes of every run, each once.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Runs {
    n_elements: usize,
    nodes: Vec<u32>,
    /// The nodes of run r are [first[r], first[r + 1]).
    first: Vec<u32>,
}

impl Runs {
    /// The runs of a mesh. Cuts do not change them.
    pub(crate) fn new(mesh: &TetMesh) -> Self {
        let mut runs = Self { n_elements: mesh.tets.len(), nodes: Vec::new(), first: vec![0] };
        let mut last_run = vec![0; mesh.nodes.len()];
        for (tets, run) in mesh.tets.chunks(ELEMENTS).zip(1u32..) {
            for &node in tets.as_flattened() {
                if std::mem::replace(&mut last_run[node as usize], run) != run {
                    runs.nodes.push(node);
                }
            }
            runs.first.push(runs.nodes.len() as u32);
        }
        runs
    }

    /// The elements of all runs whose nodes are not all beyond the same plane. `beyond` has, per node, one
    /// bit for each plane that the node is beyond.
    pub(crate) fn within_reach<'a>(&'a self, beyond: &'a [u8]) -> impl Iterator<Item = u32> + 'a {
        let runs = self.first.windows(2).enumerate();
        let runs = runs.filter(|(_, bounds)| {
            let nodes = &self.nodes[bounds[0] as usize..bounds[1] as usize];
            nodes.iter().fold(u8::MAX, |all, &node| all & beyond[node as usize]) == 0
        });
        runs.flat_map(|(r, _)| r * ELEMENTS..((r + 1) * ELEMENTS).min(self.n_elements)).map(|e| e as u32)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::mesh::{BoxPattern, box_mesh};

    #[test]
    fn no_element_is_left_out_that_is_not_beyond_one_plane() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::new(9.0, 4.0, 4.0), [9, 4, 4], BoxPattern::Tet6);
        let runs = Runs::new(&mesh);
        let beyond: Vec<u8> =
            mesh.nodes.iter().map(|x| u8::from(x.x < 3.5) | u8::from(x.z > 1.5) << 1).collect();
        let found: Vec<u32> = runs.within_reach(&beyond).collect();
        assert!(found.is_sorted() && found.len() < mesh.tets.len(), "{} elements", found.len());
        let near = |tet: &[u32; 4]| tet.iter().fold(u8::MAX, |all, &n| all & beyond[n as usize]) == 0;
        for (e, _) in (0u32..).zip(&mesh.tets).filter(|(_, tet)| near(tet)) {
            assert!(found.binary_search(&e).is_ok(), "element {e}");
        }
    }
}

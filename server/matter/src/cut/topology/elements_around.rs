//! The elements around every node of a mesh.

/// For every node the elements that have it as a corner, ascending.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct ElementsAround {
    /// The elements around node n are [start[n], start[n + 1]) of `elements`.
    start: Vec<u32>,
    elements: Vec<u32>,
}

impl ElementsAround {
    /// The elements around `n_nodes` nodes.
    pub fn new(n_nodes: usize, tets: &[[u32; 4]]) -> Self {
        let mut start = vec![0u32; n_nodes + 1];
        for &node in tets.iter().flatten() {
            start[node as usize + 1] += 1;
        }
        for i in 0..n_nodes {
            start[i + 1] += start[i];
        }
        let mut fill = start.clone();
        let mut elements = vec![0u32; 4 * tets.len()];
        for (e, tet) in (0u32..).zip(tets) {
            for &node in tet {
                elements[fill[node as usize] as usize] = e;
                fill[node as usize] += 1;
            }
        }
        Self { start, elements }
    }

    /// The elements around one node.
    pub fn of(&self, node: u32) -> &[u32] {
        &self.elements[self.range(node)]
    }

    /// Where the elements around a node stand in a list of those around all nodes.
    pub fn range(&self, node: u32) -> std::ops::Range<usize> {
        self.start[node as usize] as usize..self.start[node as usize + 1] as usize
    }

    /// Entry `k` of the list of those around all nodes.
    pub fn at(&self, k: usize) -> u32 {
        self.elements[k]
    }
}

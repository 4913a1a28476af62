//! Cuts of the mesh, each held against [`Sample::check`].

mod baselines;
mod cuts;
mod adjoining;
mod degenerate;
mod local;
mod random;
mod settings;
mod smooth;

use fastrand::Rng;
use nalgebra::{Matrix3, Vector3};

use super::complex::det;
use super::{Nodes, SnapNode, SnapReport, Snapper};
use crate::cut::{BladeSweep, CutMesh};
use crate::mesh::{BoxPattern, TetMesh, box_mesh};
use crate::testing::{Vectors as _, surface_is_closed_and_manifold, v};

/// A body under test.
struct Sample {
    snapper: Snapper,
    mesh: TetMesh,
    nodes: Vec<SnapNode>,
    volume: f64,
}

impl Sample {
    /// The box from the origin to `size` [m].
    fn new(size: [f64; 3], cells: [usize; 3], pattern: BoxPattern) -> Self {
        let mesh = box_mesh(Vector3::zeros(), size.into(), cells, pattern);
        let nodes = (0u32..).zip(&mesh.nodes).map(|(n, &x)| SnapNode::at_rest(x, n)).collect();
        Self { snapper: Snapper::default(), volume: size.iter().product(), mesh, nodes }
    }

    fn unit(cells: usize) -> Self {
        Self::new([1.0; 3], [cells; 3], BoxPattern::Tet6)
    }

    fn sweep(&mut self, segments: &[[Vector3<f64>; 2]], incision: u32) -> SnapReport {
        let blade = BladeSweep { segments: segments.to_vec() };
        let mut mesh = self.cut_mesh();
        let [x, v] = self.state();
        let data = |n: u32, node: &mut SnapNode| *node = self.nodes[n as usize];
        let nodes = Nodes { rest: &self.mesh.nodes, x: &x, v: &v, data: &data };
        let (report, cut) = self.snapper.cut(&mut mesh, nodes, &blade, incision).unwrap();
        if let Some(mut cut) = cut {
            (self.mesh, self.nodes) = (std::mem::take(&mut cut.mesh), std::mem::take(&mut cut.nodes));
            let (mut mesh, [x, _]) = (self.cut_mesh(), self.state());
            self.snapper.follow(&mut mesh, &x, &cut);
        }
        report
    }

    /// Positions [m] and velocities [m/s] of the nodes.
    fn state(&self) -> [Vec<Vector3<f64>>; 2] {
        let of = |value: fn(&SnapNode) -> Vector3<f64>| self.nodes.iter().map(value).collect();
        [of(|node| node.x), of(|node| node.v)]
    }

    /// Sweeps a square of half width `reach` [m] in the plane through `point` with the normal.
    fn cut_plane(&mut self, point: Vector3<f64>, normal: Vector3<f64>, reach: f64, id: u32) -> SnapReport {
        let n = normal.normalize();
        let helper = if n.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        let u = n.cross(&helper).normalize() * reach;
        let w = n.cross(&u);
        self.sweep(&[[point - u - w, point - u + w], [point + u - w, point + u + w]], id)
    }

    fn cut_mesh(&self) -> CutMesh {
        CutMesh::with_lips(self.mesh.clone(), self.snapper.tags(), 0).unwrap()
    }

    fn parts(&self) -> usize {
        self.cut_mesh().components().len()
    }

    /// Nodes of lips.
    fn lip_nodes(&self) -> Vec<u32> {
        let faces = self.mesh.boundary_faces();
        let lips = faces.iter().filter(|f| {
            let mut key = f.nodes;
            key.sort_unstable();
            self.snapper.tags().contains_key(&key)
        });
        let mut nodes: Vec<u32> = lips.flat_map(|f| f.nodes).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// No element is inverted in either configuration, the volume is as before, every node has one set of
    /// degrees of freedom, and the surface is closed and 2-manifold.
    fn check(&self) {
        self.mesh.check().unwrap();
        for tet in &self.mesh.tets {
            assert!(det(&tet.map(|n| self.nodes[n as usize].x)) > 0.0);
        }
        let volume: f64 = self.mesh.volumes().iter().sum();
        assert!((volume / self.volume - 1.0).abs() < 1e-9, "volume {volume} of {}", self.volume);
        let cut = self.cut_mesh();
        assert_eq!(cut.n_copies(), self.mesh.nodes.len(), "nodes shared by what does not hang together");
        surface_is_closed_and_manifold(cut.surface());
        let enclosed = cut.surface().volume(&cut.rest_positions());
        assert!((enclosed / volume - 1.0).abs() < 1e-10);
    }

    /// Applies an affine map and an affine velocity to the body.
    fn deform(&mut self, F: Matrix3<f64>, L: Matrix3<f64>) {
        for node in &mut self.nodes {
            node.x = F * node.rest;
            node.v = L * node.rest;
        }
    }
}

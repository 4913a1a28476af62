//! A node with all data that must stay consistent when the mesh around it changes.

use nalgebra::Vector3;

use crate::element::Held;

/// Origin of a node that did not exist before the cut.
pub const NEW: u32 = u32::MAX;

/// A node of a body in both configurations, with its loads and constraints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SnapNode {
    /// Rest position [m].
    pub rest: Vector3<f64>,
    /// Present position [m].
    pub x: Vector3<f64>,
    /// Velocity [m/s].
    pub v: Vector3<f64>,
    /// Directions in which the displacement is prescribed, and the displacement [m]. Such a node is neither
    /// moved nor collapsed. All duplicates of it get the same constraint.
    pub fixed: Option<(Held, Vector3<f64>)>,
    /// Force on the node itself [N].
    pub point_force: Vector3<f64>,
    /// Force spread over the material around the node [N].
    pub spread_force: Vector3<f64>,
    /// Its number before the cut, or [`NEW`].
    pub origin: u32,
}

/// All nodes of a body before a cut, as the body keeps them; lengths n_nodes.
#[derive(Clone, Copy)]
pub struct Nodes<'a> {
    /// Rest positions [m].
    pub rest: &'a [Vector3<f64>],
    /// Present positions [m].
    pub x: &'a [Vector3<f64>],
    /// Velocities [m/s].
    pub v: &'a [Vector3<f64>],
    /// Adds constraint and loads to the node with this number.
    pub data: &'a dyn Fn(u32, &mut SnapNode),
}

impl Nodes<'_> {
    /// One node with all its data.
    pub fn node(&self, n: u32) -> SnapNode {
        let at_rest = SnapNode::at_rest(self.rest[n as usize], n);
        let mut node = SnapNode { x: self.x[n as usize], v: self.v[n as usize], ..at_rest };
        (self.data)(n, &mut node);
        node
    }
}

impl SnapNode {
    /// A free node at rest.
    pub fn at_rest(rest: Vector3<f64>, origin: u32) -> Self {
        let zero = Vector3::zeros();
        Self { rest, x: rest, v: zero, fixed: None, point_force: zero, spread_force: zero, origin }
    }

    /// The material point Σ w n, without loads and constraints.
    pub fn between(nodes: &[&SnapNode], weights: &[f64]) -> Self {
        let sum = |value: fn(&SnapNode) -> Vector3<f64>| -> Vector3<f64> {
            nodes.iter().zip(weights).map(|(n, w)| value(n) * *w).sum()
        };
        Self { x: sum(|n| n.x), v: sum(|n| n.v), ..Self::at_rest(sum(|n| n.rest), NEW) }
    }

    /// Takes position and velocity of another node; loads, constraint and origin stay.
    pub fn placed_at(self, other: &SnapNode) -> Self {
        Self { rest: other.rest, x: other.x, v: other.v, ..self }
    }
}

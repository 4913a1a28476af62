//! Taking a cut back: the topology from before it, with the present motion.
//!
//! Material that a cut separated is joined where its parts are now. A node takes the mean position and
//! velocity of the copies it was split into, weighted by mass, so centre of mass and momentum stay. The
//! tissue is then stretched across the closed wound and contracts.
//!
//! A part that the cut had freed may have fallen far away. It returns to where it was, at rest.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use scindo_matter::mesh::TetMesh;

use super::boundary::Boundary;
use super::snapping::SnapState;
use super::{Body, BodyError};
use crate::space::Space;

/// The topology of a body at some time: mesh, pieces, copies and skin, without positions.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct BodyTopology {
    #[serde(with = "crate::space::saved_space")]
    space: Box<dyn Space>,
    boundary: Boundary,
    snap: Option<Box<SnapState>>,
    x: Vec<Vector3<f64>>,
    split_from: Vec<u32>,
    /// See [`Body::renumberings`].
    renumbered: u32,
    /// Whether every part was held then; if so, parts that are free now were freed by cuts since.
    held: bool,
}

impl BodyTopology {
    /// Estimated memory [byte], within a factor of about two.
    pub fn bytes(&self) -> usize {
        self.space.bytes()
    }
}

impl Body {
    /// Takes a copy of the present topology, for [`restore`](Self::restore).
    pub fn topology(&self) -> BodyTopology {
        BodyTopology {
            space: self.space.boxed_clone(),
            boundary: self.boundary.clone(),
            snap: self.snap.clone(),
            x: self.state.x.clone(),
            split_from: self.split_from.clone(),
            renumbered: self.renumbered,
            held: !self.parts.any_free(),
        }
    }

    /// Takes back every cut since `topology` was taken from this body; the epoch rises. Mass stays.
    /// Momentum and centre of mass stay too, unless a part was cut off. A cut under way is dropped.
    ///
    /// # Errors
    /// If the model cannot be built again.
    pub fn restore(&mut self, topology: BodyTopology) -> Result<(), BodyError> {
        let epoch = self.space.epoch() + 1;
        let before = Moving::of(self, topology.held);
        let strains =
            self.outline().map(|strains| strains.rooted(&self.split_from, topology.space.n_copies()));
        let BodyTopology { space, boundary, snap, x, split_from, renumbered, .. } = topology;
        let same_numbers = renumbered == self.renumbered;
        let state = match (&snap, space.tets()) {
            (Some(_), Some(tets)) => before.on_mesh(tets.mesh(), &x),
            _ if !same_numbers => before.at_places((&self.rest, &*self.space), (&space.rest_positions(), &x)),
            _ => {
                let roots = roots(&self.split_from, self.space.n_copies(), (space.n_copies(), x.len()));
                // A vertex that refinement made lies elsewhere than the one it comes from, which must not move there.
                let is_copy =
                    |(number, root): (u32, &usize)| self.space.node_of(number) == space.node_of(*root as u32);
                let copies: Vec<bool> = (0..).zip(&roots).map(is_copy).collect();
                before.joined(&x, &roots, &copies)
            }
        };
        (self.space, self.snap) = (space, snap);
        self.space.set_epoch(epoch);
        self.boundary = boundary;
        self.asleep.clear();
        self.split_from = split_from;
        self.renumbered += u32::from(!same_numbers);
        (self.state.x, self.state.v) = state;
        // Rotations and history of the cut state no longer apply: the integrator starts afresh.
        self.dynamics.rebuild(&*self.space)?;
        self.carry_viscous(strains);
        self.spring_forces.clear();
        self.follow_topology();
        if !before.lost.contains(&true) {
            before.give_momentum_to(self);
        }
        Ok(())
    }
}

/// Positions [m] and velocities [m/s] of nodes.
type Motion = (Vec<Vector3<f64>>, Vec<Vector3<f64>>);

/// Σ m [kg], Σ m x and Σ m v.
type Sum = (f64, Vector3<f64>, Vector3<f64>);

fn mean((mass, mx, mv): &Sum) -> Option<(Vector3<f64>, Vector3<f64>)> {
    (*mass > 0.0).then(|| (mx / *mass, mv / *mass))
}

/// The number that every copy and added node had, or was split from, when there were `then.0` copies among `then.1`
/// numbers; now there are `n_copies`. Added nodes come after the copies and move up with every new one.
fn roots(split_from: &[u32], n_copies: usize, then: (usize, usize)) -> Vec<usize> {
    let (copies_then, n_then) = then;
    let number_then = |number: usize| match number.checked_sub(n_copies) {
        None => Some(number).filter(|&copy| copy < copies_then),
        Some(added) => Some(copies_then + added).filter(|&number| number < n_then),
    };
    let root = |mut number: usize| loop {
        match number_then(number) {
            Some(root) => return root,
            None => number = split_from[number] as usize,
        }
    };
    (0..split_from.len()).map(root).collect()
}

/// A place as a key; −0 is 0.
fn key(place: &Vector3<f64>) -> [u64; 3] {
    [place.x, place.y, place.z].map(|c| (c + 0.0).to_bits())
}

/// Motion of a body before its topology was replaced.
struct Moving {
    mesh: TetMesh,
    x: Vec<Vector3<f64>>,
    v: Vec<Vector3<f64>>,
    mass: Vec<f64>,
    /// Copies of parts that were cut off.
    lost: Vec<bool>,
    mass_times_x: Vector3<f64>,
    momentum: Vector3<f64>,
}

impl Moving {
    /// `held`: every part was held when the topology was taken, so free parts come from cuts.
    fn of(body: &Body, held: bool) -> Self {
        let free = |&part: &u32| held && body.parts.free[part as usize];
        // The mesh is needed only if cuts have changed it.
        let tets = body.space.tets().filter(|_| body.snap.is_some());
        let mesh = tets.map_or_else(TetMesh::default, |tets| tets.mesh().clone());
        Self {
            mesh,
            x: body.state.x.clone(),
            v: body.state.v.clone(),
            mass: body.mass.clone(),
            lost: body
                .parts
                .of_copy
                .iter()
                .enumerate()
                .map(|(c, part)| free(part) || body.is_asleep(c as u32))
                .collect(),
            mass_times_x: body.centre_of_mass() * body.total_mass(),
            momentum: body.momentum(),
        }
    }

    /// Joins every first copy with all copies split from it, which `roots` tells; `copies` tells which numbers are
    /// copies of their root's node. A copy of which nothing is left goes to `x` [m].
    fn joined(&self, x: &[Vector3<f64>], roots: &[usize], copies: &[bool]) -> Motion {
        let mut sums = vec![(0.0, Vector3::zeros(), Vector3::zeros()); x.len()];
        for copy in (0..self.x.len()).filter(|&copy| !self.lost[copy] && copies[copy]) {
            self.add(copy, &mut sums[roots[copy]]);
        }
        sums.iter().zip(x).map(|(sum, x)| mean(sum).unwrap_or((*x, Vector3::zeros()))).unzip()
    }

    /// Motion of the material points that are the nodes of `mesh`, another mesh of the same body: that of
    /// nodes at the same place, else that of the element around. If a part was cut off, `x` [m] stands in
    /// for the latter.
    fn on_mesh(&self, mesh: &TetMesh, x: &[Vector3<f64>]) -> Motion {
        let mut there: BTreeMap<[u64; 3], Sum> = BTreeMap::new();
        for node in (0..self.x.len()).filter(|&node| !self.lost[node]) {
            self.add(node, there.entry(key(&self.mesh.nodes[node])).or_default());
        }
        let whole = !self.lost.contains(&true);
        let motion = mesh.nodes.iter().zip(x).map(|(point, x)| {
            let known = there.get(&key(point)).and_then(mean);
            known.unwrap_or_else(|| if whole { self.within(point) } else { (*x, Vector3::zeros()) })
        });
        motion.unzip()
    }

    /// Motion of the material that rests at `places` [m], where coarsening has given other numbers to the vertices
    /// of `space`, which rest at `rest` [m]: that of vertices there, else that of the element around. If a part
    /// was cut off, `x` [m] stands in for the latter.
    fn at_places(
        &self,
        (rest, space): (&[Vector3<f64>], &dyn Space),
        (places, x): (&[Vector3<f64>], &[Vector3<f64>]),
    ) -> Motion {
        let mut there: BTreeMap<[u64; 3], Sum> = BTreeMap::new();
        for copy in (0..self.x.len()).filter(|&copy| !self.lost[copy]) {
            self.add(copy, there.entry(key(&rest[copy])).or_default());
        }
        let whole = !self.lost.contains(&true);
        let within = |place: &Vector3<f64>| {
            let point = space.locate(*place, None).filter(|_| whole)?;
            let carriers = space.carriers(&point);
            let sample = |values: &[Vector3<f64>]| -> Vector3<f64> {
                carriers.iter().map(|&(copy, w)| w * values[copy as usize]).sum()
            };
            (!carriers.is_empty()).then(|| (sample(&self.x), sample(&self.v)))
        };
        let motion = places.iter().zip(x).map(|(place, x)| {
            let known = there.get(&key(place)).and_then(mean).or_else(|| within(place));
            known.unwrap_or((*x, Vector3::zeros()))
        });
        motion.unzip()
    }

    fn add(&self, copy: usize, (mass, mx, mv): &mut Sum) {
        let m = self.mass[copy];
        (*mass, *mx, *mv) = (*mass + m, *mx + m * self.x[copy], *mv + m * self.v[copy]);
    }

    /// Position and velocity of the material point that rests at `point` [m].
    fn within(&self, point: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let mut best = (f64::NEG_INFINITY, [0.25; 4], [0; 4]);
        for e in 0..self.mesh.tets.len() {
            let corners = self.mesh.corners(e);
            let centre = corners.iter().sum::<Vector3<f64>>() / 4.0;
            let weights = self.mesh.gradients(e).map(|g| 0.25 + g.dot(&(point - centre)));
            let depth = weights.into_iter().fold(f64::INFINITY, f64::min);
            if depth > best.0 {
                best = (depth, weights, self.mesh.tets[e]);
            }
        }
        let (_, weights, nodes) = best;
        let sample = |values: &[Vector3<f64>]| -> Vector3<f64> {
            nodes.iter().zip(weights).map(|(&n, w)| w * values[n as usize]).sum()
        };
        (sample(&self.x), sample(&self.v))
    }

    /// Translates the free nodes so that momentum and centre of mass are again those from before, except
    /// for what held nodes contribute.
    fn give_momentum_to(&self, body: &mut Body) {
        let held: Vec<u32> = body.fixed.iter().map(|fixed| fixed.copy).collect();
        let free = |c: usize| held.binary_search(&(c as u32)).is_err();
        let mass: f64 = (0..body.mass.len()).filter(|&c| free(c)).map(|c| body.mass[c]).sum();
        if mass <= 0.0 {
            return;
        }
        let shift = (self.mass_times_x - body.centre_of_mass() * body.total_mass()) / mass;
        let push = (self.momentum - body.momentum()) / mass;
        for c in (0..body.mass.len()).filter(|&c| free(c)) {
            body.state.x[c] += shift;
            body.state.v[c] += push;
        }
    }
}

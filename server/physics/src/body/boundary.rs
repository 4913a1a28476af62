//! Constraints and loads, given by node and applied by copy.

use nalgebra::Vector3;
use scindo_matter::cut::NewCopy;
use scindo_matter::cut::remesh::SnapNode;
use scindo_matter::cut::remesh::node::NEW;
use scindo_matter::element::MaterialPoint;
use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::octree::{Coarsening, OUTSIDE};
use scindo_matter::storage::reserve::resize_reserving;

use super::pressing::PressureLoad;
use super::{Body, BodyError};
use crate::space::Space;

/// A node whose displacement is prescribed in some directions.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FixedNode {
    /// Index of the node; nodes that the element adds come after those of the mesh.
    pub node: u32,
    /// The prescribed directions.
    pub held: Held,
    /// Prescribed displacement from rest [m]; only its part in the directions of `held` is used.
    pub displacement_m: Vector3<f64>,
}

/// Constraints and loads as requested; cuts do not change them.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Boundary {
    /// At most one entry per node, ascending.
    fixed: Vec<FixedNode>,
    /// Force on the material point of a node [N], by node; empty if there is none.
    point_force: Vec<Vector3<f64>>,
    /// Force spread over the material around a node [N], by node; empty if there is none.
    spread_force: Vec<Vector3<f64>>,
    /// Spread forces of which a changing share acts.
    varying: Vec<VaryingForce>,
    /// Pressures on the skin.
    pub(super) pressures: Vec<PressureLoad>,
    /// Scratch: the volume around every node [m³].
    #[serde(skip)]
    node_volume: Vec<f64>,
}

/// A force spread over the material around nodes, of which a share acts.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct VaryingForce {
    /// The whole force [N], by node.
    force: Vec<Vector3<f64>>,
    share: f64,
}

impl Boundary {
    /// Collects the constraints and loads stored with nodes.
    pub(super) fn of_nodes(nodes: &[SnapNode]) -> Self {
        let forces = |force: fn(&SnapNode) -> Vector3<f64>| -> Vec<Vector3<f64>> {
            let any = nodes.iter().any(|node| force(node) != Vector3::zeros());
            if any { nodes.iter().map(force).collect() } else { Vec::new() }
        };
        let held = (0u32..).zip(nodes).filter_map(|(node, n)| {
            let (held, displacement_m) = n.fixed?;
            Some(FixedNode { node, held, displacement_m })
        });
        Self {
            fixed: held.collect(),
            point_force: forces(|n| n.point_force),
            spread_force: forces(|n| n.spread_force),
            ..Self::default()
        }
    }

    /// Stores constraint and loads of a node with it.
    pub(super) fn onto_node(&self, number: u32, node: &mut SnapNode) {
        node.fixed = self.fixed_at(number).map(|fixed| (fixed.held, fixed.displacement_m));
        let force = |forces: &[Vector3<f64>]| forces.get(number as usize).copied().unwrap_or_default();
        node.point_force = force(&self.point_force);
        node.spread_force = force(&self.spread_force);
    }

    /// Applies the requests made between `then` and `now`. `origins` maps their nodes to the `n` nodes of
    /// `self`; requests on nodes without an origin are left out.
    pub(super) fn take_changes(&mut self, then: &Self, now: &Self, origins: &[u32], n: usize) {
        let origin = |node: u32| origins.get(node as usize).copied().filter(|&o| o != NEW);
        for old in then.fixed.iter().filter(|f| now.fixed_at(f.node).is_none()) {
            if let Some(node) = origin(old.node) {
                self.fixed.retain(|f| f.node != node);
            }
        }
        for new in now.fixed.iter().filter(|f| then.fixed_at(f.node) != Some(*f)) {
            if let Some(node) = origin(new.node) {
                self.fixed.retain(|f| f.node != node);
                let at = self.fixed.partition_point(|f| f.node < node);
                self.fixed.insert(at, FixedNode { node, ..*new });
            }
        }
        for (mine, then, now) in [
            (&mut self.point_force, &then.point_force, &now.point_force),
            (&mut self.spread_force, &then.spread_force, &now.spread_force),
        ] {
            if now.is_empty() && !then.is_empty() {
                mine.clear();
            }
            if !now.is_empty() {
                mine.resize(n, Vector3::zeros());
            }
            for (node, force) in (0u32..).zip(now) {
                let change = force - then.get(node as usize).copied().unwrap_or_default();
                if let (Some(origin), true) = (origin(node), change != Vector3::zeros()) {
                    mine[origin as usize] += change;
                }
            }
        }
    }

    fn fixed_at(&self, node: u32) -> Option<&FixedNode> {
        self.fixed.binary_search_by_key(&node, |f| f.node).ok().map(|at| &self.fixed[at])
    }

    /// Lists the fixed copies, ascending.
    ///
    /// A fixed node fixes the copies that hold the node's own material. One of them keeps the node's
    /// number. There are more if a cut passes exactly through the node, because both lips then have it.
    /// Copies without that material stay free: fixing them would glue fragments to air. `rest` are the
    /// rest positions [m] of all copies and of the nodes that the element adds. `share` is the reached
    /// fraction of the prescribed displacements.
    pub(super) fn fixed_copies(
        &self,
        space: &dyn Space,
        rest: &[Vector3<f64>],
        share: f64,
        fixed: &mut Vec<FixedCopy>,
    ) {
        // The first copy of a node of the mesh has its number.
        let copies = (0u32..).zip(space.node_of_copy());
        let mut divided = vec![false; space.n_nodes()];
        copies.filter(|(copy, node)| copy != *node).for_each(|(_, &node)| divided[node as usize] = true);
        for added in (space.n_copies()..space.n_copies() + space.n_added()).map(|number| number as u32) {
            let node = space.node_of(added);
            divided[node as usize] |= added != space.first_copy(node);
        }
        fixed.clear();
        if self.fixed.len() > fixed.capacity() {
            fixed.reserve_exact(self.fixed.len() + self.fixed.len() / 2);
        }
        for f in &self.fixed {
            let first = space.first_copy(f.node);
            let target = rest[first as usize] + share * f.displacement_m;
            let held = |copy: u32| FixedCopy { copy, held: f.held, position_m: target.into() };
            fixed.push(held(first));
            if divided[f.node as usize] {
                let copies = space.copies_with_node(f.node).into_iter();
                fixed.extend(copies.filter(|&copy| copy != first).map(held));
            }
        }
        fixed.sort_unstable_by_key(|f| f.copy);
    }

    /// Holds nodes that refinement put between held ones: in the directions that all of these are held, at the
    /// mean of their displacements.
    pub(super) fn hold_between(&mut self, new: &[NewCopy], node_of_copy: &[u32]) {
        for new in new {
            let Some(between) = &new.between else { continue };
            if let Some((held, displacement_m)) = self.between(between, node_of_copy) {
                // New nodes have the highest numbers.
                self.fixed.push(FixedNode { node: new.copy, held, displacement_m });
            }
        }
    }

    /// The directions in which all carriers of a point are held, and the mean of their displacements; `None` if there
    /// is no such direction.
    fn between(&self, point: &MaterialPoint, node_of_copy: &[u32]) -> Option<(Held, Vector3<f64>)> {
        let (mut shared, mut displacement_m) = (Held::FULLY, Vector3::zeros());
        for (copy, weight) in point.carriers() {
            let held = self.fixed_at(node_of_copy[copy])?;
            shared = shared.shared(&held.held);
            displacement_m += weight * held.displacement_m;
        }
        shared.any().then_some((shared, displacement_m))
    }

    /// Whether `node`, which lies between others with these `carriers`, has to stay when cells become coarse: it is
    /// loaded, or held in another way than the material between the carriers is.
    pub(super) fn needs(&self, node: u32, carriers: &MaterialPoint, node_of_copy: &[u32]) -> bool {
        let varying = self.varying.iter().map(|load| &load.force);
        let loaded = [&self.point_force, &self.spread_force]
            .into_iter()
            .chain(varying)
            .any(|forces| forces.get(node as usize).is_some_and(|f| *f != Vector3::zeros()));
        let held = self.fixed_at(node).copied();
        let between = self.between(carriers, node_of_copy);
        let same = match (held, between) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(held), Some((shared, displacement_m))) => {
                let near = |e: Vector3<f64>| {
                    let there = e.dot(&held.displacement_m);
                    (there - e.dot(&displacement_m)).abs() <= 1e-12 * there.abs()
                };
                shared.covers(&held.held) && held.held.directions().all(near)
            }
        };
        loaded || !same
    }

    /// Takes the numbers of the nodes after a coarsening. Nodes that vanish carry no load.
    pub(super) fn renumber(&mut self, change: &Coarsening) {
        self.fixed.retain_mut(|held| {
            held.node = change.vertex_of[held.node as usize];
            held.node != OUTSIDE
        });
        change.keep(&mut self.point_force);
        change.keep(&mut self.spread_force);
        self.varying.iter_mut().for_each(|load| change.keep(&mut load.force));
    }

    /// Forgets the nodes that refinement had added to a body of `n_nodes` nodes.
    pub(super) fn forget_refinement(&mut self, n_nodes: usize) {
        self.fixed.retain(|held| (held.node as usize) < n_nodes);
    }

    /// Writes the force [N] on every one of `n` copies and added nodes to `load`. A point force goes to
    /// the copy with the node's material. A spread force goes to all copies of the node, by the volume
    /// they carry. Totals are kept.
    pub(super) fn node_loads(&mut self, space: &dyn Space, n: usize, load: &mut Vec<Vector3<f64>>) {
        load.clear();
        resize_reserving(load, n, Vector3::zeros());
        self.add_loads(space, load);
    }

    /// The same after a cut, with `load` from before it. Point forces stay on their copies, so only
    /// spread forces are shared anew.
    pub(super) fn loads_of_new_copies(&mut self, space: &dyn Space, load: &mut Vec<Vector3<f64>>) {
        if self.spread_force.is_empty() && self.varying.is_empty() {
            resize_reserving(load, space.n_copies(), Vector3::zeros());
        } else {
            self.node_loads(space, space.n_copies(), load);
        }
    }

    fn add_loads(&mut self, space: &dyn Space, load: &mut [Vector3<f64>]) {
        for (node, f) in (0u32..).zip(&self.point_force) {
            load[space.first_copy(node) as usize] += f;
        }
        if self.spread_force.is_empty() && self.varying.is_empty() {
            return;
        }
        let Self { spread_force, varying, node_volume, .. } = self;
        let volumes = || space.copy_volumes().iter().chain(space.added_volumes());
        node_volume.clear();
        node_volume.resize(space.n_nodes(), 0.0);
        for (copy, &volume) in (0u32..).zip(volumes()) {
            node_volume[space.node_of(copy) as usize] += volume;
        }
        for (copy, (load, volume)) in (0u32..).zip(load.iter_mut().zip(volumes())) {
            let node = space.node_of(copy) as usize;
            let part = volume / node_volume[node];
            // Nodes that refinement added carry nothing: the load stays where it was put.
            if let Some(force) = spread_force.get(node) {
                *load += part * force;
            }
            for VaryingForce { force, share } in &*varying {
                if let Some(force) = force.get(node) {
                    *load += part * *share * force;
                }
            }
        }
    }
}

impl Body {
    /// Prescribes the displacement from rest [m] of `nodes` in the directions `held`, for example `[true; 3]` for
    /// all axes. A second call for a node adds directions and replaces the displacement along those given.
    pub fn fix(
        &mut self,
        nodes: &[u32],
        held: impl Into<Held>,
        displacement_m: Vector3<f64>,
    ) -> Result<(), BodyError> {
        let held = held.into();
        self.check_nodes(nodes)?;
        check_vector("displacement_m", &displacement_m)?;
        for &node in nodes {
            let at = match self.boundary.fixed.binary_search_by_key(&node, |f| f.node) {
                Ok(at) => at,
                Err(at) => {
                    let none = FixedNode { node, held: Held::NOT, displacement_m: Vector3::zeros() };
                    self.boundary.fixed.insert(at, none);
                    at
                }
            };
            let fixed = &mut self.boundary.fixed[at];
            (fixed.held, fixed.displacement_m) =
                fixed.held.with(&fixed.displacement_m, &held, &displacement_m);
        }
        self.follow_boundary();
        Ok(())
    }

    /// Sets the share of the prescribed displacements that the next step reaches; 1 at first. A
    /// displacement that arrives at once turns soft elements inside out.
    pub fn set_prescribed_share(&mut self, share: f64) {
        if share == self.prescribed_share {
            return;
        }
        self.prescribed_share = share;
        for held in &mut self.fixed {
            let node = self.space.node_of(held.copy);
            let asleep = self.asleep.binary_search_by_key(&held.copy, |held| held.copy).is_ok();
            if let (Some(asked), false) = (self.boundary.fixed_at(node), asleep) {
                held.position_m = (self.rest[held.copy as usize] + share * asked.displacement_m).into();
            }
        }
        self.range.follow(&self.rest, &self.parts, &self.fixed);
    }

    /// Frees `nodes` in all directions.
    pub fn release(&mut self, nodes: &[u32]) {
        self.boundary.fixed.retain(|f| !nodes.contains(&f.node));
        self.follow_boundary();
    }

    /// Nodes with a prescribed displacement, ascending.
    pub fn fixed_nodes(&self) -> &[FixedNode] {
        &self.boundary.fixed
    }

    /// Adds a force [N] on the material point of `node`.
    pub fn add_nodal_force(&mut self, node: u32, force_n: Vector3<f64>) -> Result<(), BodyError> {
        self.check_nodes(&[node])?;
        check_vector("force_n", &force_n)?;
        self.boundary.point_force.resize(self.space.n_nodes(), Vector3::zeros());
        self.boundary.point_force[node as usize] += force_n;
        self.follow_boundary();
        Ok(())
    }

    /// Adds a total force [N] shared by area over the skin faces all of whose nodes are in `nodes`.
    pub fn add_surface_force(&mut self, nodes: &[u32], force_n: Vector3<f64>) -> Result<(), BodyError> {
        let selected = self.selection(nodes, ("force_n", &force_n))?;
        let area = self.space.areas(&selected);
        self.add_constant(spread("surface", &area, force_n)?);
        Ok(())
    }

    /// Like [`add_surface_force`](Self::add_surface_force), for a force of which a share acts that
    /// [`set_load_shares`](Self::set_load_shares) sets; it is 1 at first.
    ///
    /// # Errors
    /// Also a body whose cuts change the mesh, because there the nodes carry their forces along.
    pub fn add_varying_surface_force(
        &mut self,
        nodes: &[u32],
        force_n: Vector3<f64>,
    ) -> Result<(), BodyError> {
        let selected = self.selection(nodes, ("force_n", &force_n))?;
        let area = self.space.areas(&selected);
        self.add_varying(spread("surface", &area, force_n)?)
    }

    /// Like [`add_volume_force`](Self::add_volume_force), with a share as in
    /// [`add_varying_surface_force`](Self::add_varying_surface_force).
    ///
    /// # Errors
    /// As there.
    pub fn add_varying_volume_force(
        &mut self,
        nodes: &[u32],
        force_n: Vector3<f64>,
    ) -> Result<(), BodyError> {
        let selected = self.selection(nodes, ("force_n", &force_n))?;
        let volume = self.space.volumes(&selected);
        self.add_varying(spread("volume", &volume, force_n)?)
    }

    /// Sets how much of every [varying force](Self::add_varying_surface_force) acts from now on, in the order in which
    /// they were added. Those without an entry keep their share. Allocates nothing.
    pub fn set_load_shares(&mut self, shares: impl Iterator<Item = f64>) {
        let mut changed = false;
        for (load, share) in self.boundary.varying.iter_mut().zip(shares) {
            changed |= load.share != share;
            load.share = share;
        }
        if changed {
            self.gather_loads();
        }
    }

    /// Adds a total force [N] shared by volume over the tets around `nodes`.
    pub fn add_volume_force(&mut self, nodes: &[u32], force_n: Vector3<f64>) -> Result<(), BodyError> {
        let selected = self.selection(nodes, ("force_n", &force_n))?;
        let volume = self.space.volumes(&selected);
        self.add_constant(spread("volume", &volume, force_n)?);
        Ok(())
    }

    /// Load on every node [N], gravity not included. Pressure is included only where it is a dead load in the step;
    /// [`pressure_forces`](Self::pressure_forces) tells it everywhere.
    pub fn loads(&self) -> &[Vector3<f64>] {
        &self.load
    }

    /// Removes all loads; gravity is not one of them.
    pub fn clear_loads(&mut self) {
        self.boundary.point_force.clear();
        self.boundary.spread_force.clear();
        self.boundary.varying.clear();
        self.boundary.pressures.clear();
        self.follow_boundary();
    }

    pub(super) fn selection(
        &self,
        nodes: &[u32],
        (quantity, value): (&'static str, &Vector3<f64>),
    ) -> Result<Vec<bool>, BodyError> {
        self.check_nodes(nodes)?;
        check_vector(quantity, value)?;
        let mut selected = vec![false; self.space.n_nodes()];
        nodes.iter().for_each(|&n| selected[n as usize] = true);
        Ok(selected)
    }

    fn add_constant(&mut self, force: Vec<Vector3<f64>>) {
        self.boundary.spread_force.resize(force.len(), Vector3::zeros());
        self.boundary.spread_force.iter_mut().zip(force).for_each(|(sum, force)| *sum += force);
        self.follow_boundary();
    }

    fn add_varying(&mut self, force: Vec<Vector3<f64>>) -> Result<(), BodyError> {
        if self.snap.is_some() {
            let (what, with) = ("a load that varies", "cutting that changes the mesh");
            return Err(BodyError::Combination { what, with, instead: "cutting method xfem" });
        }
        self.boundary.varying.push(VaryingForce { force, share: 1.0 });
        self.follow_boundary();
        Ok(())
    }

    fn check_nodes(&self, nodes: &[u32]) -> Result<(), BodyError> {
        let n_nodes = self.space.n_nodes();
        match nodes.iter().find(|&&n| n as usize >= n_nodes) {
            Some(&node) => Err(BodyError::NoSuchNode { node, n_nodes }),
            None => Ok(()),
        }
    }
}

/// A total force [N] shared over nodes in proportion to their `weight`.
fn spread(
    carrier: &'static str,
    weight: &[f64],
    force_n: Vector3<f64>,
) -> Result<Vec<Vector3<f64>>, BodyError> {
    let total: f64 = weight.iter().sum();
    if total <= 0.0 {
        return Err(BodyError::NothingSelected { carrier, force_n: force_n.into() });
    }
    Ok(weight.iter().map(|weight| (weight / total) * force_n).collect())
}

fn check_vector(quantity: &'static str, v: &Vector3<f64>) -> Result<(), BodyError> {
    if v.iter().all(|c| c.abs() < 1e12) {
        Ok(())
    } else {
        Err(BodyError::NonFinite { quantity, found: (*v).into() })
    }
}

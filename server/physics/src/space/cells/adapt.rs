//! Refinement and coarsening of the octree of a body.

use scindo_matter::cut::{Front, NewCopy};
use scindo_matter::element::MaterialPoint;
use scindo_matter::octree::{Activity, AdaptSettings, Coarsening, Family, OctreeChange, Plan};

use super::OctreeSpace;

/// What a refinement did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OctreeRefinement {
    /// The change of the octree.
    pub change: OctreeChange,
    /// New vertices.
    pub new_copies: Vec<NewCopy>,
}

impl OctreeSpace {
    /// Divides these leaves. Returns the new vertices; all earlier ones keep their numbers.
    pub fn refine(&mut self, leaves: &[u32]) -> OctreeRefinement {
        let known = self.octree.n_vertices() as u32;
        let change = self.octree.divide_leaves(leaves);
        let new_copies = self.number_copies(known, &change);
        self.changed.clone_from(&change.cells);
        self.only_cut = false;
        if change.divided > 0 {
            if let Some(runs) = &mut self.runs {
                runs.follow(&self.octree, &self.changed);
            }
            self.epoch += 1;
            self.octree.follow_volumes(&change, &mut self.volumes);
            self.surface.follow(&self.octree, &self.changed, &[]);
            if let Some(own) = &mut self.own {
                own.follow(&self.octree, &self.surface, &self.changed);
            }
        }
        OctreeRefinement { change, new_copies }
    }

    /// What to change by `settings`; no leaf of the uncut body is ever joined with others.
    pub fn plan(&self, settings: &AdaptSettings, activity: &Activity<'_>) -> Plan {
        let mut plan = self.octree.plan(settings, activity);
        plan.coarsen.retain(|family| self.was_one(family));
        plan
    }

    /// Whether one leaf of the uncut body fills a family.
    fn was_one(&self, family: &Family) -> bool {
        let leaf = self.initial.leaf(family.at);
        self.initial.cells().get(leaf as usize).is_some_and(|cell| cell.level >= family.level)
    }

    /// Joins these families where that is allowed, so far as the uncut body had larger leaves: its vertices keep
    /// their numbers. Vertices that a cut has split, or that the front of an incision hangs on, stay too, and
    /// those for which `stays` says so.
    pub fn coarsen(
        &mut self,
        families: &[Family],
        stays: &dyn Fn(u32, &MaterialPoint) -> bool,
    ) -> Coarsening {
        let mut bound = vec![false; self.octree.n_vertices()];
        let copies = (0u32..).zip(&self.node_of_copy).filter(|(copy, node)| copy != *node);
        for vertex in copies.flat_map(|(copy, &node)| [copy, node]) {
            bound[vertex as usize] = true;
        }
        let held = self.fronts.values().flat_map(Front::copies).chain(self.borders.copies());
        held.for_each(|vertex| bound[vertex as usize] = true);
        let families: Vec<Family> = families.iter().copied().filter(|family| self.was_one(family)).collect();
        let change =
            self.octree.coarsen(&families, &|vertex, point| bound[vertex as usize] || stays(vertex, point));
        if change.joined == 0 {
            return change;
        }
        self.runs = None;
        self.epoch += 1;
        change.keep(&mut self.node_of_copy);
        let number = |vertex: u32| change.vertex_of[vertex as usize];
        self.node_of_copy.iter_mut().for_each(|node| *node = number(*node));
        self.fronts.values_mut().for_each(|front| front.renumber(number));
        self.borders.renumber(number);
        self.changed.clone_from(&change.cells);
        self.only_cut = false;
        self.volumes = self.octree.vertex_volumes();
        self.surface.follow_coarsening(&self.octree, &change);
        if let Some(own) = &mut self.own {
            own.follow_coarsening(&self.octree, &self.surface, &change);
        }
        change
    }
}

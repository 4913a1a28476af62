//! A body of the simulation: mechanics plus what the world knows about it.

use std::mem::Discriminant;
use std::sync::Arc;

use scindo_physics::body::{Body, Notice};
use scindo_physics::cut::IncisionMark;
use scindo_physics::estimate::{MeshError, StressRecovery};

use super::report::Energy;
use crate::mesh_in::MeshHealth;
use crate::plan::BodySize;
use crate::snapshot::SurfaceTopology;

/// A deformable body with its name and its groups of held nodes.
#[derive(Debug)]
pub struct SimBody {
    /// Name.
    pub id: Arc<str>,
    /// Its mechanics.
    pub body: Body,
    /// Held nodes, one group per `fix` of the scene, ascending.
    pub fix_groups: Vec<Vec<u32>>,
    /// The same before the first cut that changed the mesh.
    fix_groups_uncut: Option<Vec<Vec<u32>>>,
    /// What was found and repaired in its mesh file; none for a body without a file.
    pub health: Option<MeshHealth>,
    /// Volume at rest [m³].
    pub rest_volume_m3: f64,
    /// What was told of the last step.
    pub(crate) noticed: Option<Discriminant<Notice>>,
    recovery: StressRecovery,
    topology: Option<Arc<SurfaceTopology>>,
    surface: Vec<[f32; 3]>,
    surface_is_old: bool,
    marks: Vec<IncisionMark>,
    marks_are_old: bool,
}

impl SimBody {
    pub(crate) fn new(id: &str, body: Body, health: Option<MeshHealth>) -> Self {
        let rest_volume_m3 = body.cut_mesh().copy_volume().iter().sum();
        Self {
            id: id.into(),
            body,
            fix_groups: Vec::new(),
            fix_groups_uncut: None,
            health,
            rest_volume_m3,
            noticed: None,
            recovery: StressRecovery::default(),
            topology: None,
            surface: Vec::new(),
            surface_is_old: true,
            marks: Vec::new(),
            marks_are_old: true,
        }
    }

    /// Topology epoch; rises with every cut that did something and with every reset.
    pub fn epoch(&self) -> u32 {
        self.body.cut_mesh().epoch()
    }

    /// The sizes that costs follow from.
    pub fn size(&self) -> BodySize {
        let surface = self.body.surface();
        BodySize {
            elements: self.body.n_elements(),
            nodes: self.body.rest_positions().len(),
            vertices: surface.vertices.len(),
            triangles: surface.triangles.len(),
        }
    }

    /// Surface positions [m], computed when they are asked for and old.
    pub fn surface_positions(&mut self) -> &[[f32; 3]] {
        if self.surface_is_old {
            self.body.surface_positions(&mut self.surface);
            self.surface_is_old = false;
        }
        &self.surface
    }

    /// Surface positions [m] as last computed, with the body they belong to.
    pub(crate) fn surface_now(&mut self) -> (&Body, &[[f32; 3]]) {
        self.surface_positions();
        (&self.body, &self.surface)
    }

    /// Surface velocities [m/s] into `out`.
    pub fn surface_velocities(&self, out: &mut Vec<[f32; 3]>) {
        let v = self.body.velocities();
        out.clear();
        out.extend(self.body.surface().vertices.iter().map(|vertex| {
            let v = vertex.position(v);
            [v.x as f32, v.y as f32, v.z as f32]
        }));
    }

    /// Ends [m] of the lines that incisions have drawn on the surface without opening it, into `out`.
    pub fn incision_marks(&mut self, out: &mut Vec<[[f32; 3]; 2]>) {
        if self.marks_are_old {
            self.marks = self.body.incision_marks();
            self.marks_are_old = false;
        }
        let x = self.body.positions();
        out.clear();
        out.extend(
            self.marks.iter().map(|mark| mark.ends.map(|end| end.position(x).map(|c| c as f32).into())),
        );
    }

    /// Kinetic and elastic energy.
    pub fn energy(&self) -> Energy {
        Energy { kinetic_j: self.body.kinetic_energy(), elastic_j: self.body.elastic_energy() }
    }

    /// Estimate of the discretisation error; only of bodies of tet4.
    pub fn mesh_error(&mut self) -> Option<MeshError> {
        self.body.mesh_error(&mut self.recovery)
    }

    /// To be told whenever the body moved.
    pub(crate) fn has_moved(&mut self) {
        self.surface_is_old = true;
    }

    /// To be told whenever a blade went through the body, whether or not it opened something.
    pub(crate) fn has_been_swept(&mut self) {
        self.marks_are_old = true;
    }

    /// To be told whenever the body was cut or reset.
    pub(crate) fn has_changed_topology(&mut self) {
        self.topology = None;
        self.surface_is_old = true;
        self.marks_are_old = true;
        self.follow_nodes();
    }

    /// Groups of nodes after a cut that changed the mesh: a duplicate is in the groups of its node.
    fn follow_nodes(&mut self) {
        let Some(origins) = self.body.node_origins() else { return };
        let uncut = self.fix_groups_uncut.get_or_insert_with(|| self.fix_groups.clone());
        for (now, uncut) in self.fix_groups.iter_mut().zip(uncut) {
            let from_group = |(_, origin): &(u32, &u32)| uncut.binary_search(origin).is_ok();
            *now = (0u32..).zip(origins).filter(from_group).map(|(node, _)| node).collect();
        }
    }

    /// Triangles of the present epoch; made when first asked for.
    pub fn topology(&mut self) -> Arc<SurfaceTopology> {
        let (mesh, surface) = (self.body.cut_mesh(), self.body.surface());
        let make = || {
            Arc::new(SurfaceTopology {
                epoch: mesh.epoch(),
                vertex_count: surface.vertices.len() as u32,
                triangles: surface.triangles.clone(),
                tags: surface.tags.clone(),
            })
        };
        self.topology.get_or_insert_with(make).clone()
    }
}

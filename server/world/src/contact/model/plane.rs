//! What a haptic client needs to render contact at 1 kHz on its own: planes with a linearised force.

use nalgebra::{Isometry3, Vector3};

use crate::tool::compound::MAX_PARTS;

/// Most planes of one model: those of the capsules of a tool first, then the walls and edges beside them, and one that
/// hides a change of model.
pub const MAX_CONTACTS: usize = 6;
const _: () = assert!(MAX_CONTACTS > MAX_PARTS);

/// Feature number of the plane that hides a change of model; see [`super::continuity`].
pub const BLEND_FEATURE: u64 = u64::MAX;

/// One contact plane. The force on the tool with its tip at p is
/// n · max(0, force·n − stiffness (p − tip used)·n), and with friction μ across n the force
/// (I − n nᵀ) (force − tangential stiffness (p − tip used)), at most μ times that along n.
///
/// The forces of several planes add up. A plane that is the edge of another one has no force of its own, and takes that
/// of the other away as the tool passes beyond it.
///
/// Before contact `force_n`·n is negative, −stiffness · gap. The client's force therefore starts from zero in
/// the very tick in which the tip crosses the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPlane {
    /// A point of the plane on the surface [m].
    pub point_m: Vector3<f64>,
    /// Unit normal, from the tissue to the tool.
    pub normal: Vector3<f64>,
    /// Distance of the tool from the plane [m]. Negative values are penetration.
    pub gap_m: f64,
    /// Force of the tissue on the tool at the pose used [N]. Along −normal the tool does not touch yet.
    pub force_n: Vector3<f64>,
    /// Loss of force per metre along the normal [N/m].
    pub stiffness_n_m: f64,
    /// The same at once, before the tissue moves [N/m]; zero if it is not known.
    pub instant_stiffness_n_m: f64,
    /// The same after the tissue has followed the tool [N/m]; zero if it is not known.
    pub relaxed_stiffness_n_m: f64,
    /// Time in which the force falls from the one to the other [s].
    pub relaxation_s: f64,
    /// Restoring force per metre across the normal [N/m].
    pub tangential_stiffness_n_m: f64,
    /// Coefficient of dry friction: the force across the normal is at most this times that along it. 0: a free slide,
    /// or tissue that is held.
    pub friction: f64,
    /// Force against relative velocity along the normal [N·s/m].
    pub damping_ns_m: f64,
    /// Velocity of the surface without the push of the tool [m/s].
    pub surface_velocity_m_s: Vector3<f64>,
    /// Distance of the tip from the point, across the normal, up to which the plane is trusted [m]. Of an edge: way over
    /// which the load of the plane that it ends falls to zero [m].
    pub patch_radius_m: f64,
    /// Number that stays the same while the tool touches the same place.
    pub feature_id: u64,
    /// Number of the plane whose tissue ends at this one; `None` for a plane that pushes.
    pub edge_of: Option<usize>,
}

/// State of the contact of a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ContactMode {
    /// No surface within reach: no plane.
    #[default]
    Free,
    /// Planes act on the tool.
    Contact,
    /// The blade cuts. A plane resists it where the tissue has a toughness.
    Cutting,
    /// The tool holds tissue.
    Hold,
}

/// A local contact model of one tool.
#[derive(Debug, Clone)]
pub struct LocalContact {
    /// State of the contact.
    pub mode: ContactMode,
    /// At most [`MAX_CONTACTS`] planes.
    pub planes: Vec<ContactPlane>,
    /// Index of the body of the first plane; `None` without planes.
    pub body: Option<usize>,
    /// Topology epoch of that body.
    pub epoch: u32,
    /// The pose about which the planes are linearised.
    pub pose_used: Isometry3<f64>,
    /// Time after which the client must fade out the force [s].
    pub validity_s: f64,
    /// Largest force to render [N].
    pub max_force_n: f64,
    /// Largest stiffness to render [N/m].
    pub max_stiffness_n_m: f64,
    /// Number of the step that the snapshot shows.
    pub step: u64,
    /// Simulated time of the snapshot [s].
    pub time_s: f64,
}

impl Default for LocalContact {
    fn default() -> Self {
        Self {
            mode: ContactMode::Free,
            planes: Vec::with_capacity(MAX_CONTACTS),
            body: None,
            epoch: 0,
            pose_used: Isometry3::identity(),
            validity_s: 0.0,
            max_force_n: 0.0,
            max_stiffness_n_m: 0.0,
            step: 0,
            time_s: 0.0,
        }
    }
}

impl LocalContact {
    /// Force of the tissue on a tool with its tip at `p` [N]. Clients evaluate the same law.
    pub fn force_at(&self, p: Vector3<f64>) -> Vector3<f64> {
        let moved = p - self.pose_used.translation.vector;
        let share = |number: usize| -> f64 {
            let edges = self.planes.iter().filter(|plane| plane.edge_of == Some(number));
            edges.map(|edge| edge.edge_share(moved)).product()
        };
        self.planes.iter().enumerate().map(|(number, plane)| share(number) * plane.force_at(moved)).sum()
    }
}

impl ContactPlane {
    /// A plane without force.
    pub const NONE: Self = Self {
        point_m: Vector3::new(0.0, 0.0, 0.0),
        normal: Vector3::new(0.0, 0.0, 1.0),
        gap_m: 0.0,
        force_n: Vector3::new(0.0, 0.0, 0.0),
        stiffness_n_m: 0.0,
        instant_stiffness_n_m: 0.0,
        relaxed_stiffness_n_m: 0.0,
        relaxation_s: 0.0,
        tangential_stiffness_n_m: 0.0,
        friction: 0.0,
        damping_ns_m: 0.0,
        surface_velocity_m_s: Vector3::new(0.0, 0.0, 0.0),
        patch_radius_m: 0.0,
        feature_id: 0,
        edge_of: None,
    };

    /// Share of the load that an edge leaves to the plane that it ends, after the tip moved by `moved` [m].
    fn edge_share(&self, moved: Vector3<f64>) -> f64 {
        (-(self.gap_m + self.normal.dot(&moved)) / self.patch_radius_m).clamp(0.0, 1.0)
    }

    /// Force on the tool [N] after its tip moved by `moved` [m] from the pose used.
    pub fn force_at(&self, moved: Vector3<f64>) -> Vector3<f64> {
        let n = &self.normal;
        let load = (self.force_n.dot(n) - self.stiffness_n_m * moved.dot(n)).max(0.0);
        if self.friction <= 0.0 {
            return n * load;
        }
        let back = self.force_n - self.tangential_stiffness_n_m * moved;
        n * load + (back - n * n.dot(&back)).cap_magnitude(self.friction * load)
    }
}

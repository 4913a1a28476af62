//! The grip of forceps: surface points that their inner faces squeeze, and hold by dry friction.
//!
//! A face takes hold of the tissue next to it at a few places, and keeps these material points until they leave the
//! jaws. Each becomes a rough spring against the plane of the face, so that pressure and friction come from the solve of
//! the step. The anchor of the friction moves with the jaw. Where the friction is at its bound μ f_n, the anchor is
//! dragged along the jaw: the tissue slips.
//!
//! The jaws are coupled by their hinge. They yield together until each squeezes with no more than the force of the grip,
//! and close together where it is less. A load from the side therefore meets both jaws, and does not open them, up to
//! a bound.

use nalgebra::{Isometry3, Point3, Vector3};
use scindo_collision::barycentric_point;
use scindo_physics::body::{PointSpring, SpringKind};

use super::spring::material_points;
use super::surface::ContactSurface;
use super::{Behind, BodyContacts, corner_of};
use crate::inputs::ToolShape;
use crate::tool::Tool;
use crate::tool::compound::inner_face;

type V = Vector3<f64>;

/// Places on a face: along the jaw in shares of its length, and across it in radii.
const PLACES: [[f64; 2]; 6] = [[0.0, -0.5], [0.0, 0.5], [0.12, -0.5], [0.12, 0.5], [0.24, -0.5], [0.24, 0.5]];
/// Stiffness of the spring of one place in multiples of that of the tool. Together they are stiffer than the hand, so
/// that the gap of the jaws is that of the tissue.
const STIFFNESS: f64 = 1.0;
/// Largest force of a jaw under a load from the side, in multiples of that of the grip; shared by its points.
const SIDE_LOAD: f64 = 4.0;
/// Distance of tissue before a face at which it is taken, in radii.
const NEAR: f64 = 0.2;
/// Depth of tissue behind a face up to which it is taken, in radii ...
const DEEP: f64 = 1.0;
/// ... and beyond these [m].
const REACH_M: f64 = 0.004;
/// Largest cosine between the normals of face and tissue. The skin may lie across the jaws, but not behind them.
const FACING: f64 = 0.3;
/// Distance from the places of a face, or from the face, at which a point has left the jaws, in radii.
const LEFT: f64 = 1.5;
/// Weight of the present step where the jaws yield or close.
const YIELD: f64 = 0.5;
/// Largest part of the opening by which jaws that squeeze too little close in a step.
const CLOSE: f64 = 0.05;
/// Share of its bound from which friction counts as at it.
const AT_BOUND: f64 = 0.999;

/// A surface point at one place of a face.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Held {
    body: usize,
    epoch: u32,
    triangle: u32,
    barycentric: [f64; 3],
    /// Present position [m].
    point: V,
    /// Where it sticks to the jaw, in tool axes [m].
    anchor: Point3<f64>,
    /// Unit normal of the face, towards the other jaw.
    normal: V,
    /// Its springs on the body: the first, and how many.
    springs: (usize, usize),
    /// Stiffness of its spring [N/m].
    stiffness: f64,
    /// Force on the tissue from the last solve [N].
    force: V,
    /// After a step in which it slipped: its anchor, as seen from the point [m].
    slipped: Option<V>,
}

impl Held {
    fn push(&self) -> f64 {
        self.force.dot(&self.normal).max(0.0)
    }
}

/// The grip of one pair of forceps.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Jaws {
    /// Distance of the faces at their ends [m]; `None` while they do not grip.
    gap_m: Option<f64>,
    /// Pose of the tool in the last step.
    pose: Isometry3<f64>,
    held: [[Option<Held>; PLACES.len()]; 2],
}

/// What a grip needs to know of its forceps.
struct Forceps {
    radius: f64,
    length: f64,
    opening: f64,
    grip: f64,
    friction: f64,
}

impl Forceps {
    fn of(tool: &Tool) -> Option<Self> {
        let ToolShape::Forceps { radius_m, length_m, opening_m, grip_force_n, friction } = tool.shape else {
            return None;
        };
        Some(Self { radius: radius_m, length: length_m, opening: opening_m, grip: grip_force_n, friction })
    }
}

/// The face of one jaw in world axes.
struct Face {
    end: V,
    way: V,
    across: V,
    normal: V,
}

impl Face {
    fn new(forceps: &Forceps, gap_m: f64, jaw: usize, pose: &Isometry3<f64>) -> Self {
        let (end, way, normal) = inner_face(forceps.length, gap_m, if jaw == 0 { 1.0 } else { -1.0 });
        let across = pose.rotation * V::y() * forceps.radius;
        Self { end: (pose * Point3::from(end)).coords, way: pose * way, across, normal: pose * normal }
    }

    fn place(&self, [along, across]: [f64; 2]) -> V {
        self.end + self.way * along + self.across * across
    }

    /// How far `point` is behind the face [m].
    fn depth(&self, point: V) -> f64 {
        self.normal.dot(&(self.end - point))
    }
}

impl Jaws {
    /// Releases all points.
    pub fn open(&mut self) {
        self.gap_m = None;
        self.held = Default::default();
    }

    /// Distance of the inner faces at the ends of the jaws [m]; `None` while they do not grip.
    pub fn gap_m(&self) -> Option<f64> {
        self.gap_m
    }

    /// Centroid of the points that are squeezed [m]; `None` unless both jaws squeeze.
    pub fn held_point(&self) -> Option<V> {
        let mut sum = V::zeros();
        let mut count = 0.0;
        for jaw in &self.held {
            let squeezed = jaw.iter().flatten().filter(|held| held.push() > 0.0);
            let before = count;
            for held in squeezed {
                sum += held.point;
                count += 1.0;
            }
            if count == before {
                return None;
            }
        }
        Some(sum / count)
    }

    /// Follows the tool to its present pose, and takes what is next to its faces.
    pub fn follow(&mut self, tool: &Tool, surfaces: &[ContactSurface]) {
        let Some(forceps) = Forceps::of(tool) else { return self.open() };
        let gap_m = self.gap_m.unwrap_or(tool.gap_m()).max(tool.gap_m());
        self.gap_m = Some(gap_m);
        for jaw in 0..2 {
            let face = Face::new(&forceps, gap_m, jaw, &tool.pose);
            for (slot, place) in self.held[jaw].iter_mut().zip(PLACES) {
                if let Some(held) = slot
                    && !(held.refresh(&self.pose, surfaces, &forceps)
                        && is_between(&forceps, &face, &tool.pose, held.point))
                {
                    *slot = None;
                }
                if slot.is_none() {
                    *slot = take(&forceps, &face, place, &tool.pose, surfaces);
                }
                if let Some(held) = slot {
                    held.normal = face.normal;
                    (held.springs, held.stiffness) = ((0, 0), 0.0);
                }
            }
        }
        self.pose = tool.pose;
    }

    /// Adds the springs of all points.
    pub(super) fn squeeze(
        &mut self,
        index: u32,
        tool: &Tool,
        surfaces: &[ContactSurface],
        bodies: &mut [BodyContacts],
    ) {
        let (Some(forceps), Some(gap_m)) = (Forceps::of(tool), self.gap_m) else { return };
        for jaw in 0..2 {
            let face = Face::new(&forceps, gap_m, jaw, &tool.pose);
            let count = self.held[jaw].iter().flatten().count() as f64;
            let most = (SIDE_LOAD * forceps.grip).min(tool.max_force_n) / count.max(1.0);
            for held in self.held[jaw].iter_mut().flatten() {
                let Some(tree) = surfaces[held.body].tree() else { continue };
                let BodyContacts { vertices, springs, behind, .. } = &mut bodies[held.body];
                let corners = tree.corners(held.triangle).map(|v| &vertices[v as usize]);
                let triangle = tree.triangle(held.triangle);
                let first = springs.len();
                let stiffness = STIFFNESS * tool.stiffness_n_m;
                let depth = face.depth(held.point);
                let back = (tool.pose * held.anchor).coords - held.point;
                let bound = forceps.friction * held.push();
                material_points(corners, held.barycentric, |vertex, share| {
                    let at = if share == 1.0 { held.point } else { triangle[corner_of(&vertex, corners)] };
                    springs.push(PointSpring {
                        point: vertex,
                        kind: SpringKind::Rough {
                            normal: held.normal,
                            offset_m: depth + held.normal.dot(&at),
                            anchor_m: at + back,
                            friction: forceps.friction,
                            tangential_n_m: stiffness * share,
                            grip_n: bound * share,
                        },
                        stiffness_n_m: stiffness * share,
                        max_force_n: most * share,
                    });
                    behind.push(Behind { tool: index, limb: 0, depth_m: depth, rubs: None });
                });
                held.springs = (first, springs.len() - first);
                held.stiffness = stiffness;
            }
        }
    }

    /// Records the forces of the springs on `body` from the solve [N].
    pub fn collect(&mut self, body: usize, forces: &[V]) {
        for held in self.held.iter_mut().flatten().flatten().filter(|held| held.body == body) {
            let (first, count) = held.springs;
            held.force = forces.get(first..first + count).unwrap_or_default().iter().sum();
        }
    }

    /// After the solve of a step: drags the anchors of points that slipped, and moves the jaws towards the force of the
    /// grip.
    pub fn settle(&mut self, tool: &Tool) {
        let (Some(forceps), Some(gap_m)) = (Forceps::of(tool), self.gap_m) else { return };
        let (mut push, mut stiffness) = (0.0, 0.0);
        for held in self.held.iter_mut().flatten().flatten() {
            let normal = held.push();
            let across = held.force - held.force.dot(&held.normal) * held.normal;
            let slips = across.norm() >= AT_BOUND * forceps.friction * normal;
            held.slipped = (slips && held.stiffness > 0.0).then(|| across / held.stiffness);
            push += 0.5 * normal;
            stiffness += 0.5 * held.stiffness;
        }
        let wanted = tool.gap_m();
        self.gap_m = Some(if stiffness > 0.0 {
            let by = (2.0 * YIELD * (push - forceps.grip) / stiffness).max(-CLOSE * forceps.opening);
            (gap_m + by).clamp(wanted, forceps.opening.max(wanted))
        } else {
            wanted
        });
    }
}

/// Whether a point is still next to a face.
fn is_between(forceps: &Forceps, face: &Face, pose: &Isometry3<f64>, point: V) -> bool {
    let at = pose.inverse_transform_point(&Point3::from(point));
    let last = PLACES.iter().fold(0.0, |last: f64, place| last.max(place[0])) * forceps.length;
    let off = LEFT * forceps.radius;
    (-off..=last + off).contains(&at.z) && at.y.abs() <= off && face.depth(point) > -off
}

/// The tissue at one place of a face, if there is some.
fn take(
    forceps: &Forceps,
    face: &Face,
    place: [f64; 2],
    pose: &Isometry3<f64>,
    surfaces: &[ContactSurface],
) -> Option<Held> {
    let at = face.place(place);
    let reach = DEEP * forceps.radius + REACH_M;
    let near = surfaces.iter().enumerate().filter_map(|(body, surface)| {
        let tree = surface.tree()?;
        let faces = |t: u32| {
            let [a, b, c] = tree.triangle(t);
            let normal = (b - a).cross(&(c - a));
            normal.dot(&face.normal) <= FACING * normal.norm()
        };
        let on = tree.closest_point_where(at, reach, faces)?;
        (on.signed_distance <= NEAR * forceps.radius).then_some((body, on))
    });
    let (body, on) = near.min_by(|a, b| a.1.signed_distance.abs().total_cmp(&b.1.signed_distance.abs()))?;
    is_between(forceps, face, pose, on.point).then(|| Held {
        body,
        epoch: surfaces[body].epoch(),
        triangle: on.triangle,
        barycentric: on.barycentric,
        point: on.point,
        anchor: pose.inverse_transform_point(&Point3::from(on.point)),
        normal: face.normal,
        springs: (0, 0),
        stiffness: 0.0,
        force: V::zeros(),
        slipped: None,
    })
}

impl Held {
    /// Takes over where the point is now, with the tool at `pose` in the last step. After a change of topology it
    /// becomes the nearest point of the new surface. Returns whether there is one.
    fn refresh(&mut self, pose: &Isometry3<f64>, surfaces: &[ContactSurface], forceps: &Forceps) -> bool {
        let Some(surface) = surfaces.get(self.body) else { return false };
        let Some(tree) = surface.tree() else { return false };
        if surface.epoch() == self.epoch {
            self.point = barycentric_point(&tree.triangle(self.triangle), self.barycentric);
        } else {
            let Some(on) = tree.closest_point(self.point, forceps.radius) else { return false };
            self.epoch = surface.epoch();
            (self.triangle, self.barycentric, self.point) = (on.triangle, on.barycentric, on.point);
        }
        if let Some(back) = self.slipped.take() {
            self.anchor = pose.inverse_transform_point(&Point3::from(self.point + back));
        }
        true
    }
}

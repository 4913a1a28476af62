//! Tissue held by a tool: material points bound when the grip closes, and pulled along with the tool.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::contact::surface::ContactSurface;
use scindo_collision::barycentric_point;

/// Most material points in one grip.
pub const MAX_HELD: usize = 7;
/// Largest distance beyond the tool's radius at which it can take hold [m].
const REACH_M: f64 = 0.004;

/// One surface point in the grip.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Held {
    /// Triangle of the body's surface.
    pub triangle: u32,
    /// Barycentric coordinates on it.
    pub barycentric: [f64; 3],
    /// Position at which the tool holds it, in tool axes [m].
    pub in_tool: Point3<f64>,
    /// Present position [m].
    pub point: Vector3<f64>,
}

/// The tissue that one tool holds.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Grip {
    body: usize,
    epoch: u32,
    held: Vec<Held>,
    closed: bool,
}

impl Grip {
    /// An empty grip with memory for all points it can hold.
    pub fn new() -> Self {
        Self { held: Vec::with_capacity(MAX_HELD), ..Self::default() }
    }

    /// Releases all points.
    pub fn open(&mut self) {
        self.held.clear();
        self.closed = false;
    }

    /// The body held and the points in the grip.
    pub fn held(&self) -> (usize, &[Held]) {
        (self.body, &self.held)
    }

    /// Closes on the tissue nearest to the tip, once per grip, and then updates the points it holds. `radius`
    /// [m] is that of the tool and of the ring of points taken.
    pub fn hold(&mut self, tool: &Isometry3<f64>, radius: f64, surfaces: &[ContactSurface]) {
        if self.closed {
            self.refresh(radius, surfaces);
        } else {
            self.closed = true;
            self.close(tool, radius, surfaces);
        }
    }

    fn close(&mut self, tool: &Isometry3<f64>, radius: f64, surfaces: &[ContactSurface]) {
        let tip = tool.translation.vector;
        let nearest = surfaces
            .iter()
            .enumerate()
            .filter_map(|(body, surface)| {
                let on = surface.tree()?.closest_point(tip, radius + REACH_M)?;
                Some((body, on))
            })
            .min_by(|a, b| a.1.signed_distance.abs().total_cmp(&b.1.signed_distance.abs()));
        let Some((body, middle)) = nearest else { return };
        self.body = body;
        self.epoch = surfaces[body].epoch();
        let Some(tree) = surfaces[body].tree() else { return };
        let across = middle.normal.cross(&Vector3::ith(middle.normal.iamin(), 1.0)).normalize();
        let along = middle.normal.cross(&across);
        // One point in the middle and a ring around it, so that the grip also transmits rotation.
        for i in 0..MAX_HELD {
            let angle = std::f64::consts::TAU * i as f64 / (MAX_HELD - 1) as f64;
            let ring = if i == 0 { 0.0 } else { radius.max(0.5 * REACH_M) };
            let aside = (across * angle.cos() + along * angle.sin()) * ring;
            let Some(on) = tree.closest_point(middle.point + aside, radius + REACH_M) else {
                continue;
            };
            self.held.push(Held {
                triangle: on.triangle,
                barycentric: on.barycentric,
                in_tool: tool.inverse_transform_point(&Point3::from(on.point)),
                point: on.point,
            });
        }
    }

    /// Updates the held points. After a change of topology each becomes the nearest point of the new surface.
    fn refresh(&mut self, radius: f64, surfaces: &[ContactSurface]) {
        let Some(surface) = surfaces.get(self.body) else { return self.held.clear() };
        let Some(tree) = surface.tree() else { return self.held.clear() };
        if surface.epoch() == self.epoch {
            for held in &mut self.held {
                held.point = barycentric_point(&tree.triangle(held.triangle), held.barycentric);
            }
            return;
        }
        self.epoch = surface.epoch();
        self.held.retain_mut(|held| {
            let Some(on) = tree.closest_point(held.point, radius + REACH_M) else { return false };
            *held = Held {
                triangle: on.triangle,
                barycentric: on.barycentric,
                point: on.point,
                in_tool: held.in_tool,
            };
            true
        });
    }
}

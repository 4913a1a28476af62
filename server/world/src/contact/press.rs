//! How a tool presses: one direction, a fixed stencil of points on the tool, and smooth shares.
//!
//! The tool's reaction is along the line from device to proxy, as for any god-object. The tissue is pushed
//! against that direction at the points where rays from a stencil on the tool meet it: eight points along a
//! shaft, the pole and two rings around it on a ball. Each point bears in proportion to its depth. Stencil,
//! direction and shares change smoothly with pose and surface, so a steady hand feels a steady force. The
//! triangles on which the proxy happens to rest have no influence.
//!
//! A ball needs that many points. With the pole and one ring of six, tissue stood up between them, and the force on
//! a slide at constant depth went up and down by 15 %, which no haptic client can foretell. With two rings the
//! largest error of the haptic table at a delay of 50 ms fell from a fifth to a tenth.

use nalgebra::{Isometry3, Vector3};
use scindo_collision::{Capsule, CapsuleMotion};

use crate::contact::rings::{MAX_POINTS, RINGS};
use crate::contact::rub::Rub;
use crate::contact::surface::ContactSurface;
use crate::inputs::ToolShape;
use crate::tool::geometry::{capsule, core_length};

/// Points along a shaft.
const SHAFT: usize = 8;
/// Distance of a surface from the proxy beyond which it does not count as touched, in radii ...
const MARGIN_RADII: f64 = 0.05;
/// ... but at least this [m].
const LEAST_MARGIN_M: f64 = 2e-5;
/// Offset between device and proxy above which their line is the direction [m]. Below it, the normal of the
/// touched surface is used.
const CLEAR_OFFSET_M: f64 = 5e-5;
/// Cosine of the half angle of the cone within which the direction is kept, like dry friction of 0.18. While
/// the hand is still, a proxy on the facets of a dent wanders by as much.
const STICK_COSINE: f64 = 0.984;
/// Time in which the direction follows [s], and the most that it does in a step. The facets of a dent turn the
/// line from device to proxy back and forth from step to step.
const TURN: Following = Following { time_s: 0.095, most: 0.1 };
/// The same of the shares. Shares that followed at once would oscillate: a point that bears more sinks the
/// tissue under it, and then bears less.
const FOLLOW: Following = Following { time_s: 0.028, most: 0.3 };
/// Share below which a point is omitted.
const LEAST_SHARE: f64 = 1e-3;

/// The surface place nearest to a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Index of the body.
    pub body: usize,
    /// Triangle of the body's surface.
    pub triangle: u32,
    /// Barycentric coordinates of the place.
    pub barycentric: [f64; 3],
    /// Position in space [m].
    pub point: Vector3<f64>,
    /// Unit normal, from the tissue to the tool.
    pub normal: Vector3<f64>,
    /// Distance between tool and surface [m].
    pub gap: f64,
    /// Position along the tool's core, 0..=1.
    pub parameter: f64,
}

/// The surface place nearest to a capsule that is outside the bodies, no farther than `reach` [m].
pub fn nearest(tool: &Capsule, surfaces: &[ContactSurface], reach: f64) -> Option<Nearest> {
    let found = surfaces.iter().enumerate().filter_map(|(body, surface)| {
        let tree = surface.tree()?;
        let near = tree.closest_triangle(tool, reach)?;
        let away = near.closest.on_segment - near.closest.on_triangle;
        let outward = tree.normal_at(near.triangle, near.closest.barycentric);
        Some(Nearest {
            body,
            triangle: near.triangle,
            barycentric: near.closest.barycentric,
            point: near.closest.on_triangle,
            normal: away.try_normalize(1e-9).unwrap_or(outward),
            gap: near.distance - tool.radius,
            parameter: near.closest.parameter,
        })
    });
    found.min_by(|a, b| a.gap.total_cmp(&b.gap))
}

/// Distance of a surface from a proxy of this radius up to which it counts as touched [m].
pub fn touch_margin(radius: f64) -> f64 {
    (MARGIN_RADII * radius).max(LEAST_MARGIN_M)
}

/// The place a proxy touches, if it touches one. A proxy that is kept from the device has met something, even if the
/// surface has given way a little since.
pub fn touched((proxy, device): (&Capsule, &Capsule), surfaces: &[ContactSurface]) -> Option<Nearest> {
    let away = |i: usize| (proxy.core[i] - device.core[i]).norm();
    let is_kept = away(0).max(away(1)) > CLEAR_OFFSET_M;
    let margin = touch_margin(proxy.radius);
    nearest(proxy, surfaces, if is_kept { margin.max(proxy.radius) } else { margin })
}

/// How a running value follows the present one, so that it takes the same time at any length of step.
struct Following {
    time_s: f64,
    most: f64,
}

impl Following {
    /// Weight of a step of `h` seconds.
    fn weight(&self, h: f64) -> f64 {
        (1.0 - (-h / self.time_s).exp()).min(self.most)
    }
}

/// Unit direction in which the touched tissue pushes back the tool.
pub fn push_direction(at: &Nearest, proxy: &Capsule, device: &Capsule) -> Vector3<f64> {
    let offset = proxy.core_point(at.parameter) - device.core_point(at.parameter);
    (offset + at.normal * CLEAR_OFFSET_M).try_normalize(1e-9).unwrap_or(at.normal)
}

/// Turns the direction `held` so far by no more than needed to have `target` in its cone.
fn held_direction(held: Vector3<f64>, target: Vector3<f64>) -> Vector3<f64> {
    let cosine = held.dot(&target);
    if cosine >= STICK_COSINE {
        return held;
    }
    let Some(aside) = (held - target * cosine).try_normalize(1e-9) else { return target };
    target * STICK_COSINE + aside * (1.0 - STICK_COSINE * STICK_COSINE).sqrt()
}

/// The direction `held` after it has followed `target` for `h` seconds.
pub fn followed_direction(held: Vector3<f64>, target: Vector3<f64>, h: f64) -> Vector3<f64> {
    let goal = held_direction(held, target);
    held.lerp(&goal, TURN.weight(h)).try_normalize(1e-3).unwrap_or(goal)
}

/// One point at which a tool presses on tissue.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Bearing {
    /// Index of the body.
    pub body: usize,
    /// Triangle of its surface.
    pub triangle: u32,
    /// Barycentric coordinates on the triangle.
    pub barycentric: [f64; 3],
    /// Position in space [m].
    pub point: Vector3<f64>,
    /// How far the tool at the device pose lies beyond the point, against the direction [m].
    pub depth: f64,
    /// Share of the tool's stiffness; all shares sum to at most 1.
    pub share: f64,
    /// Number of the point in the stencil.
    pub number: u8,
}

/// The pressing of one tool, smoothed over the steps.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Press {
    direction: Option<Direction>,
    shares: [f64; MAX_POINTS],
    bearings: Vec<Bearing>,
    /// Position of the nearest place along the core, 0..=1.
    parameter: f64,
    rub: Rub,
}

#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Direction {
    normal: Vector3<f64>,
    across: Vector3<f64>,
}

impl Press {
    /// A press with memory for all its points.
    pub fn new() -> Self {
        Self { bearings: Vec::with_capacity(MAX_POINTS), ..Self::default() }
    }

    /// Direction in which the tissue pushes the tool; `None` while nothing is touched.
    pub fn normal(&self) -> Option<Vector3<f64>> {
        self.direction.map(|direction| direction.normal)
    }

    /// Points at which the tool presses.
    pub fn bearings(&self) -> &[Bearing] {
        &self.bearings
    }

    /// Releases the tissue that the tool pressed on.
    pub fn release(&mut self) {
        self.direction = None;
        self.shares = [0.0; MAX_POINTS];
        self.bearings.clear();
        self.slip();
    }

    /// Lets the tissue slip off a tool that is elsewhere without having moved there.
    pub fn slip(&mut self) {
        self.rub = Rub::default();
    }

    /// Lets friction follow the hand to `device`, after [`update`](Self::update).
    pub fn drag(&mut self, shape: ToolShape, device: &Isometry3<f64>) {
        if let Some(Direction { normal, .. }) = &self.direction {
            self.rub.follow(shape, device, self.parameter, normal);
        }
    }

    /// Friction with the tissue.
    pub fn rub(&self) -> &Rub {
        &self.rub
    }

    /// The same, to hand over what a solve found.
    pub(super) fn rub_mut(&mut self) -> &mut Rub {
        &mut self.rub
    }

    /// Finds the bearing points at the present poses of proxy and device, in a step of `h` seconds.
    pub fn update(
        &mut self,
        shape: ToolShape,
        (proxy, device): (&Isometry3<f64>, &Isometry3<f64>),
        surfaces: &[ContactSurface],
        h: f64,
    ) {
        let (at_proxy, at_device) = (capsule(shape, proxy), capsule(shape, device));
        let Some(place) = touched((&at_proxy, &at_device), surfaces) else { return self.release() };
        let target = push_direction(&place, &at_proxy, &at_device);
        let direction = turned(self.direction, target, h);
        self.direction = Some(direction);
        self.parameter = place.parameter;
        self.bearings.clear();
        let mut depths = [0.0; MAX_POINTS];
        let mut hits = [None; MAX_POINTS];
        for i in 0..MAX_POINTS {
            let Some(point) = stencil(i, shape, &direction) else { continue };
            let hit = cast(&point, (&at_proxy, &at_device), direction.normal, surfaces);
            depths[i] = hit.map_or(0.0, |bearing: Bearing| bearing.depth.max(0.0));
            hits[i] = hit;
        }
        // A touch may begin without depth. The first depths of it count as they are, or they would mix with nothing.
        let fresh = self.shares == [0.0; MAX_POINTS];
        self.follow_shares(&depths, if fresh { 1.0 } else { FOLLOW.weight(h) });
        for (number, (hit, share)) in (0u8..).zip(hits.iter().zip(self.shares)) {
            if let (Some(bearing), true) = (hit, share > LEAST_SHARE) {
                self.bearings.push(Bearing { share, number, ..*bearing });
            }
        }
    }

    /// Moves the shares towards the proportions of the depths by this weight.
    fn follow_shares(&mut self, depths: &[f64; MAX_POINTS], weight: f64) {
        let sum: f64 = depths.iter().sum();
        if sum <= 0.0 {
            return;
        }
        for (share, depth) in self.shares.iter_mut().zip(depths) {
            *share += weight * (depth / sum - *share);
        }
    }
}

/// Turns the direction towards `target` for `h` seconds, and carries its frame along without twist.
fn turned(before: Option<Direction>, target: Vector3<f64>, h: f64) -> Direction {
    let normal = match before {
        Some(before) => followed_direction(before.normal, target, h),
        None => target,
    };
    let hint = before.map_or_else(|| Vector3::ith(normal.iamin(), 1.0), |before| before.across);
    let across = (hint - normal * normal.dot(&hint))
        .try_normalize(1e-3)
        .unwrap_or_else(|| normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize());
    Direction { normal, across }
}

/// A stencil point: its position along the core, its offset to the side, and the depth of the tool's surface
/// below the core there.
struct StencilPoint {
    parameter: f64,
    aside: Vector3<f64>,
    below: f64,
}

/// Point `i` of the stencil of a shape.
fn stencil(i: usize, shape: ToolShape, direction: &Direction) -> Option<StencilPoint> {
    let ToolShape::Sphere { radius_m } = shape else {
        let parameter = i as f64 / (SHAFT - 1) as f64;
        let radius = crate::tool::geometry::core_radius(shape);
        let on_shaft = StencilPoint { parameter, aside: Vector3::zeros(), below: radius };
        return (i < SHAFT && (core_length(shape) > 0.0 || i == 0)).then_some(on_shaft);
    };
    if i == 0 {
        return Some(StencilPoint { parameter: 0.0, aside: Vector3::zeros(), below: radius_m });
    }
    let mut number = i - 1;
    for (points, radius) in RINGS {
        if number < points {
            let angle = std::f64::consts::TAU * number as f64 / points as f64;
            let along = direction.normal.cross(&direction.across);
            return Some(StencilPoint {
                parameter: 0.0,
                aside: (direction.across * angle.cos() + along * angle.sin()) * (radius_m * radius),
                below: radius_m * (1.0 - radius * radius).sqrt(),
            });
        }
        number -= points;
    }
    None
}

/// Casts a ray from the proxy against `normal`, down to the tool at the device pose, and returns the tissue
/// it meets.
fn cast(
    point: &StencilPoint,
    (proxy, device): (&Capsule, &Capsule),
    normal: Vector3<f64>,
    surfaces: &[ContactSurface],
) -> Option<Bearing> {
    // The ray starts on the device's line, at the height of the proxy. The proxy itself wanders in its dent,
    // and a stencil that wandered along would dent the tissue in changing places.
    let at_device = device.core_point(point.parameter);
    let height = normal.dot(&(proxy.core_point(point.parameter) - at_device));
    let start = at_device + point.aside + normal * (height + proxy.radius);
    let lowest = at_device + point.aside - normal * point.below;
    let way = normal.dot(&(start - lowest));
    if way <= 0.0 {
        return None;
    }
    let ray = CapsuleMotion { start: [start; 2], end: [start - normal * way; 2], radius: 0.0 };
    let hit = surfaces.iter().enumerate().filter_map(|(body, surface)| {
        let impact = surface.tree()?.sweep(&ray)?;
        Some((body, impact))
    });
    let (body, impact) = hit.min_by(|a, b| a.1.time.total_cmp(&b.1.time))?;
    Some(Bearing {
        body,
        triangle: impact.triangle,
        barycentric: impact.barycentric,
        point: impact.point,
        depth: normal.dot(&(impact.point - lowest)),
        share: 0.0,
        number: 0,
    })
}

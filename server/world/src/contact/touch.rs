//! Where a tool touches: contact points with normals and depths, from proxy and device.
//!
//! Points are found at the proxy, which only touches; depths are measured at the device, behind
//! the plane of each point. A shaft gets up to eight points spread along it; a ball in one plane
//! gets a patch that widens with depth, so that its force is not a needle's.

use nalgebra::{Isometry3, Vector3};
use scindo_collision::{Capsule, NearTriangle};

use crate::contact::surface::ContactSurface;
use crate::inputs::ToolShape;
use crate::tool::geometry::{capsule, core_length};

/// Most contact points of one tool.
pub const MAX_CONTACTS: usize = 8;
/// Distance from the proxy at which a triangle no longer counts as touched, in radii ...
const MARGIN_RADII: f64 = 0.05;
/// ... but at least this [m].
const LEAST_MARGIN_M: f64 = 2e-5;
/// Contacts whose normals differ by less (cosine) and that are close along the shaft are one.
const SAME_DIRECTION: f64 = 0.87;
/// Points of a patch around its middle, and the middle's share of the stiffness.
const RING: usize = 6;
const MIDDLE_SHARE: f64 = 0.25;
/// Radius of the ring in patch radii.
const RING_RADIUS: f64 = 0.7;

/// One contact point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Index of the body.
    pub body: usize,
    /// Triangle of its surface.
    pub triangle: u32,
    /// Where on the triangle.
    pub barycentric: [f64; 3],
    /// Where in space [m].
    pub point: Vector3<f64>,
    /// Unit, from the tissue to the tool.
    pub normal: Vector3<f64>,
    /// How far the device is behind the plane of the point [m]; negative: in front.
    pub depth: f64,
    /// Share of the tool's stiffness; the shares of one direction sum to at most 1.
    pub share: f64,
    /// Where on the tool's core, 0..=1.
    pub parameter: f64,
    /// Radius around the point in which the tool touches [m].
    pub patch_radius: f64,
}

/// Finds contact points; owns the scratch.
#[derive(Debug, Clone)]
pub struct TouchFinder {
    near: Vec<(usize, NearTriangle)>,
    found: Vec<Touch>,
}

impl Default for TouchFinder {
    fn default() -> Self {
        Self { near: Vec::with_capacity(1024), found: Vec::with_capacity(MAX_CONTACTS) }
    }
}

impl TouchFinder {
    /// Contact points of a tool with its proxy at `proxy` and its hand at `device`, at most
    /// [`MAX_CONTACTS`], nearest first.
    pub fn find(
        &mut self,
        shape: ToolShape,
        proxy: &Isometry3<f64>,
        device: &Isometry3<f64>,
        surfaces: &[ContactSurface],
    ) -> &[Touch] {
        self.find_planes(shape, proxy, device, surfaces, 0.0);
        if let ([middle], ToolShape::Sphere { radius_m }) = (&self.found[..], shape)
            && middle.depth > 0.0
        {
            let middle = *middle;
            self.widen(&middle, radius_m, device.translation.vector, surfaces);
        }
        &self.found
    }

    /// As [`find`](Self::find), but one point where a ball has a patch, and also what is not
    /// touched but within `reach` [m]; that has no share.
    pub fn find_planes(
        &mut self,
        shape: ToolShape,
        proxy: &Isometry3<f64>,
        device: &Isometry3<f64>,
        surfaces: &[ContactSurface],
        reach: f64,
    ) -> &[Touch] {
        let at_proxy = capsule(shape, proxy);
        let at_device = capsule(shape, device);
        let margin = (MARGIN_RADII * at_proxy.radius).max(LEAST_MARGIN_M);
        self.gather(&at_proxy, surfaces, margin.max(reach));
        self.select(&at_proxy, &at_device, surfaces, core_length(shape));
        self.share(&at_proxy, margin);
        &self.found
    }

    /// Triangles within reach of the proxy, seen from their front, nearest first.
    fn gather(&mut self, proxy: &Capsule, surfaces: &[ContactSurface], margin: f64) {
        self.near.clear();
        let near = &mut self.near;
        for (body, surface) in surfaces.iter().enumerate() {
            let Some(tree) = surface.tree() else { continue };
            tree.triangles_near(proxy, margin, |hit| {
                let away = hit.closest.on_segment - hit.closest.on_triangle;
                if away.dot(&tree.area_normal(hit.triangle)) >= 0.0 && near.len() < near.capacity() {
                    near.push((body, hit));
                }
            });
        }
        near.sort_unstable_by(|(b0, a), (b1, b)| {
            let nearer = a.distance.total_cmp(&b.distance);
            nearer.then(b0.cmp(b1)).then(a.triangle.cmp(&b.triangle))
        });
    }

    /// Keeps what differs in direction or lies apart along the shaft.
    fn select(&mut self, proxy: &Capsule, device: &Capsule, surfaces: &[ContactSurface], length: f64) {
        self.found.clear();
        let spacing = (length / (MAX_CONTACTS - 1) as f64).max(2.0 * proxy.radius);
        for (body, hit) in &self.near {
            let Some(tree) = surfaces[*body].tree() else { continue };
            let away = hit.closest.on_segment - hit.closest.on_triangle;
            let normal = away
                .try_normalize(1e-9)
                .unwrap_or_else(|| tree.normal_at(hit.triangle, hit.closest.barycentric));
            let parameter = hit.closest.parameter;
            let known = self.found.iter().any(|t| {
                let apart = (t.parameter - parameter).abs() * length;
                t.normal.dot(&normal) > SAME_DIRECTION && apart < spacing
            });
            if known {
                continue;
            }
            let point = hit.closest.on_triangle;
            self.found.push(Touch {
                body: *body,
                triangle: hit.triangle,
                barycentric: hit.closest.barycentric,
                point,
                normal,
                depth: device.radius - normal.dot(&(device.core_point(parameter) - point)),
                // The distance, until `share` replaces it.
                share: hit.distance,
                parameter,
                patch_radius: proxy.radius,
            });
            if self.found.len() == MAX_CONTACTS {
                break;
            }
        }
    }

    /// Shares the stiffness so that along each normal the shares sum to one, fading over the
    /// outer half of the margin: a contact that comes or goes does so without a jump.
    fn share(&mut self, proxy: &Capsule, margin: f64) {
        let mut fades = [0.0; MAX_CONTACTS];
        for (fade, touch) in fades.iter_mut().zip(&self.found) {
            *fade = (2.0 - 2.0 * (touch.share - proxy.radius) / margin).clamp(0.0, 1.0);
        }
        let mut shares = [0.0; MAX_CONTACTS];
        for (i, touch) in self.found.iter().enumerate() {
            let alike = |j: usize| {
                let cosine = touch.normal.dot(&self.found[j].normal).max(0.0);
                fades[j] * cosine * cosine
            };
            let sum: f64 = (0..self.found.len()).map(alike).sum();
            shares[i] = if sum > 0.0 { fades[i] / sum.max(1.0) } else { 0.0 };
        }
        for (touch, share) in self.found.iter_mut().zip(shares) {
            touch.share = share;
        }
    }

    /// Replaces a ball's single contact by its middle and a ring of the patch it presses.
    fn widen(&mut self, middle: &Touch, radius: f64, device: Vector3<f64>, surfaces: &[ContactSurface]) {
        let Some(tree) = surfaces[middle.body].tree() else { return };
        // Where a ball that deep cuts the undeformed plane.
        let patch = (2.0 * radius * middle.depth).sqrt().min(radius);
        let (across, along) = tangents(middle.normal);
        self.found[0].patch_radius = patch;
        self.found[0].share *= MIDDLE_SHARE;
        for i in 0..RING {
            let angle = std::f64::consts::TAU * i as f64 / RING as f64;
            let aside = (across * angle.cos() + along * angle.sin()) * (RING_RADIUS * patch);
            let Some(on) = tree.closest_point(middle.point + aside, radius) else { continue };
            if on.normal.dot(&middle.normal) < 0.3 {
                continue;
            }
            let offset = on.point - device;
            let height = offset.dot(&middle.normal);
            let lateral_squared = offset.norm_squared() - height * height;
            let profile = (radius * radius - lateral_squared).max(0.0).sqrt();
            self.found.push(Touch {
                triangle: on.triangle,
                barycentric: on.barycentric,
                point: on.point,
                depth: profile + height,
                share: middle.share * (1.0 - MIDDLE_SHARE) / RING as f64,
                patch_radius: patch,
                ..*middle
            });
        }
    }
}

/// Two unit vectors across `normal` and each other.
fn tangents(normal: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let axis = normal.iamin();
    let across = normal.cross(&Vector3::ith(axis, 1.0)).normalize();
    (across, normal.cross(&across))
}

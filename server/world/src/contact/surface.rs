//! The surface of one body for contact: refitted after every motion, and changed where a cut changed it.

use nalgebra::Vector3;
use scindo_collision::{Method, SurfaceBvh, SurfaceError};
use scindo_physics::cut::Surface;

/// The surface of one body. It is empty until its first update.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct ContactSurface {
    tree: Option<SurfaceBvh>,
    method: Method,
    epoch: u32,
    off: bool,
    /// Whether the body has moved on since the last update.
    is_old: bool,
    /// Per triangle the incision it is a lip of, and per vertex its area [m²]; only where bodies touch bodies.
    tags: Vec<u32>,
    areas: Vec<f64>,
}

impl ContactSurface {
    /// An empty surface whose triangles are to be arranged by `method`.
    pub fn new(method: Method) -> Self {
        Self { method, ..Self::default() }
    }

    /// Arranges the triangles by another method from the next update on.
    pub fn arrange_by(&mut self, method: Method) {
        if self.method != method {
            (self.method, self.tree) = (method, None);
        }
    }

    /// Moves the surface to `positions` [m]. It refits in place within an epoch, and takes over the triangles
    /// when the epoch differs. Returns whether it did that. A surface that was [left](Self::leave) behind has no motion.
    ///
    /// # Errors
    /// If triangles and positions do not belong together. The surface is not changed then.
    pub fn update(
        &mut self,
        epoch: u32,
        triangles: &[[u32; 3]],
        positions: &[[f32; 3]],
    ) -> Result<bool, SurfaceError> {
        let was_old = std::mem::take(&mut self.is_old);
        match &mut self.tree {
            Some(tree) if self.epoch == epoch => {
                tree.refit(positions)?;
                if was_old {
                    tree.forget_motion();
                }
                Ok(false)
            }
            Some(tree) => {
                tree.change_topology(positions, triangles)?;
                self.epoch = epoch;
                Ok(true)
            }
            None => {
                self.tree = Some(SurfaceBvh::with_method(self.method, positions, triangles)?);
                self.epoch = epoch;
                Ok(true)
            }
        }
    }

    /// Leaves the surface where it is, although the body moves on: nothing can meet it.
    pub fn leave(&mut self) {
        self.is_old = true;
    }

    /// Whether the body has moved on since the last update, or there was none.
    pub fn is_old(&self) -> bool {
        self.is_old || self.tree.is_none()
    }

    /// Takes over what contact of bodies needs of `surface`, with the positions of its vertices at rest [m].
    pub fn measure(&mut self, surface: &Surface, rest: impl Fn(u32) -> Vector3<f64>) {
        self.tags.clone_from(&surface.tags);
        self.areas.clear();
        self.areas.resize(surface.vertices.len(), 0.0);
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(&rest);
            let third = (b - a).cross(&(c - a)).norm() / 6.0;
            triangle.iter().for_each(|&v| self.areas[v as usize] += third);
        }
    }

    /// The incision that a triangle is a lip of; 0 for the skin.
    pub fn tag(&self, triangle: u32) -> u32 {
        self.tags.get(triangle as usize).copied().unwrap_or(0)
    }

    /// A third of the area of the triangles around a vertex, at rest [m²].
    pub fn vertex_area(&self, vertex: u32) -> f64 {
        self.areas.get(vertex as usize).copied().unwrap_or(0.0)
    }

    /// Includes the body in contact or excludes it.
    pub fn switch(&mut self, on: bool) {
        self.off = !on;
    }

    /// The tree; `None` before the first update and while switched off.
    pub fn tree(&self) -> Option<&SurfaceBvh> {
        self.tree.as_ref().filter(|_| !self.off)
    }

    /// The tree, also while the surface is switched off for tools; `None` before the first update.
    pub fn whole(&self) -> Option<&SurfaceBvh> {
        self.tree.as_ref()
    }

    /// The topology epoch to which the tree belongs.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Forgets the motion of the last update, e.g. after a reset.
    pub fn forget_motion(&mut self) {
        if let Some(tree) = &mut self.tree {
            tree.forget_motion();
        }
    }
}

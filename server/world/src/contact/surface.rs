//! The surface of one body for contact: one tree per topology, refitted after every motion.

use scindo_collision::{SurfaceBvh, SurfaceError};

/// The surface of one body. It is empty until its first update.
#[derive(Debug, Clone, Default)]
pub struct ContactSurface {
    tree: Option<SurfaceBvh>,
    epoch: u32,
    off: bool,
}

impl ContactSurface {
    /// Moves the surface to `positions` [m]. It refits in place within an epoch, and builds a new tree when
    /// the epoch differs. Returns whether it built one.
    ///
    /// # Errors
    /// If triangles and positions do not belong together. The surface is not changed then.
    pub fn update(
        &mut self,
        epoch: u32,
        triangles: &[[u32; 3]],
        positions: &[[f32; 3]],
    ) -> Result<bool, SurfaceError> {
        match &mut self.tree {
            Some(tree) if self.epoch == epoch => tree.refit(positions).map(|()| false),
            _ => {
                self.tree = Some(SurfaceBvh::new(positions, triangles)?);
                self.epoch = epoch;
                Ok(true)
            }
        }
    }

    /// Includes the body in contact or excludes it.
    pub fn switch(&mut self, on: bool) {
        self.off = !on;
    }

    /// The tree; `None` before the first update and while switched off.
    pub fn tree(&self) -> Option<&SurfaceBvh> {
        self.tree.as_ref().filter(|_| !self.off)
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

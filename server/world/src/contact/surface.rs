//! The surface of one body as contact sees it: a tree per topology, refitted per motion.

use scindo_collision::{SurfaceBvh, SurfaceError};

/// One body's surface; empty until its first update.
#[derive(Debug, Clone, Default)]
pub struct ContactSurface {
    tree: Option<SurfaceBvh>,
    epoch: u32,
    off: bool,
}

impl ContactSurface {
    /// Brings the surface to `positions` [m]: refits in place within an epoch, builds a new tree
    /// when the epoch differs. Returns whether it was built anew.
    ///
    /// # Errors
    /// When triangles and positions do not belong together; the surface is then as it was.
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

    /// Takes the body out of contact, or back in.
    pub fn switch(&mut self, on: bool) {
        self.off = !on;
    }

    /// The tree; `None` before the first update and while switched off.
    pub fn tree(&self) -> Option<&SurfaceBvh> {
        self.tree.as_ref().filter(|_| !self.off)
    }

    /// The topology the tree belongs to.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Takes the surface to have stood still since the last update, as after a reset.
    pub fn forget_motion(&mut self) {
        if let Some(tree) = &mut self.tree {
            tree.forget_motion();
        }
    }
}

//! One plane of a message as a load on the tip.

use nalgebra::Vector3;

/// A plane as a load that is linear along its normal: max(0, offset − stiffness n·p) n.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneLoad {
    /// Unit, from the tissue to the tool.
    pub normal: Vector3<f64>,
    /// Load extrapolated to n·p = 0 [N].
    pub offset_n: f64,
    /// Decrease of the load per metre along the normal [N/m].
    pub stiffness_n_m: f64,
    /// Damping along the normal, against the relative velocity [N·s/m].
    pub damping_ns_m: f64,
    /// Velocity of the surface [m/s].
    pub surface_velocity_m_s: Vector3<f64>,
    /// Whether it also pulls: the tissue is held.
    pub two_sided: bool,
    /// Coefficient of dry friction.
    pub friction: f64,
    /// Friction across the normal with the tip where it is [N].
    pub friction_n: Vector3<f64>,
    /// From the tip to the place of contact [m].
    pub arm_m: Vector3<f64>,
}

impl PlaneLoad {
    /// Load with the tip at `p` [N]; it pulls only if it has two sides.
    pub fn at(&self, p: &Vector3<f64>) -> f64 {
        let load = self.offset_n - self.stiffness_n_m * self.normal.dot(p);
        if self.two_sided { load } else { load.max(0.0) }
    }

    /// Whether it acts with the tip at `p`.
    pub fn acts(&self, p: &Vector3<f64>) -> bool {
        self.two_sided || self.at(p) > 0.0
    }
}

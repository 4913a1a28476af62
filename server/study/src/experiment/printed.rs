//! Figures printed in the paper (tables 1 and 2; one core of a Xeon X5560 at 2.8 GHz), and the stiffness numbers
//! with which its error reductions come out here.

/// What the paper prints of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Name in the paper.
    pub name: &'static str,
    /// Hexahedra before the cut: octree and uniform grid; and after the cut.
    pub cells: [f64; 3],
    /// Seconds of cutting, of a step, and of a step with the uniform grid.
    pub seconds: [f64; 3],
    /// Seconds of multigrid in a step.
    pub multigrid_s: f64,
    /// ‖e₃‖/‖e₀‖ of three cycles.
    pub reduction: f64,
    /// The same of conjugate gradients with Jacobi in that time, and the seconds that they need to do as much.
    pub gradients: [f64; 2],
}

/// The bunny at 155 cells across.
pub const BUNNY: Printed = Printed {
    name: "Bunny",
    cells: [118e3, 755e3, 197e3],
    seconds: [0.693, 2.42, 9.31],
    multigrid_s: 1.30,
    reduction: 0.100,
    gradients: [0.935, 9.76],
};

/// The cube with rotated blades.
pub const CUBE: Printed = Printed {
    name: "Cube",
    cells: [83.3e3, 512e3, 230e3],
    seconds: [0.781, 3.13, 7.05],
    multigrid_s: 1.94,
    reduction: 0.0145,
    gradients: [0.870, 31.9],
};

/// The bunny with one octree level less.
pub const BUNNY_2: Printed = Printed {
    name: "Bunny 2",
    cells: [26.1e3, 94.3e3, 42.4e3],
    seconds: [0.143, 0.498, 1.12],
    multigrid_s: 0.270,
    reduction: 0.107,
    gradients: [0.864, 1.22],
};

/// The bunny with two octree levels less.
pub const BUNNY_3: Printed = Printed {
    name: "Bunny 3",
    cells: [5.48e3, 11.9e3, 8.27e3],
    seconds: [0.0286, 0.0928, 0.130],
    multigrid_s: 0.0532,
    reduction: 0.0734,
    gradients: [0.655, 0.172],
};

/// Leaves of the cube with a soft layer: before and after the cut.
pub const LAYERED: [f64; 2] = [83e3, 321e3];
/// Seconds of cutting and a step of the same.
pub const LAYERED_S: f64 = 5.5;

/// Rates of the cycle: uncut, aligned and rotated blades.
pub const RATES: [f64; 3] = [0.66, 0.75, 0.75];

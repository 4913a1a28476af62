//! Figures printed in the paper (tables 1 and 2; one core of a Xeon X5560 at 2.8 GHz), and the stiffness numbers
//! with which its error reductions come out here.

/// What the paper prints of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Printed {
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

impl Printed {
    /// How many times as long conjugate gradients take as multigrid.
    pub(super) fn ratio(&self) -> f64 {
        self.gradients[1] / self.multigrid_s
    }
}

/// The bunny at 155 cells across.
pub(super) const BUNNY: Printed = Printed {
    name: "Bunny",
    cells: [118e3, 755e3, 197e3],
    seconds: [0.693, 2.42, 9.31],
    multigrid_s: 1.30,
    reduction: 0.100,
    gradients: [0.935, 9.76],
};

/// The cube with rotated blades.
pub(super) const CUBE: Printed = Printed {
    name: "Cube",
    cells: [83.3e3, 512e3, 230e3],
    seconds: [0.781, 3.13, 7.05],
    multigrid_s: 1.94,
    reduction: 0.0145,
    gradients: [0.870, 31.9],
};

/// The bunny with one octree level less.
pub(super) const BUNNY_2: Printed = Printed {
    name: "Bunny 2",
    cells: [26.1e3, 94.3e3, 42.4e3],
    seconds: [0.143, 0.498, 1.12],
    multigrid_s: 0.270,
    reduction: 0.107,
    gradients: [0.864, 1.22],
};

/// The bunny with two octree levels less.
pub(super) const BUNNY_3: Printed = Printed {
    name: "Bunny 3",
    cells: [5.48e3, 11.9e3, 8.27e3],
    seconds: [0.0286, 0.0928, 0.130],
    multigrid_s: 0.0532,
    reduction: 0.0734,
    gradients: [0.655, 0.172],
};

pub(super) const ARMADILLO: Printed = Printed {
    name: "Armadillo",
    cells: [493e3, 3717e3, 643e3],
    seconds: [2.24, 8.24, 47.2],
    multigrid_s: 4.35,
    reduction: 0.019,
    gradients: [0.973, 101.0],
};

/// A picture whose caption prints cells, and seconds of cutting and step together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Picture {
    pub name: &'static str,
    /// Hexahedra before the cut, if printed, and after it.
    pub cells: [Option<f64>; 2],
    /// Seconds of cutting and a step.
    pub both_s: f64,
}

/// Figures 11, 13 and 15.
pub(super) const PICTURES: [Picture; 4] = [
    Picture { name: "figure 11, left", cells: [Some(83e3), Some(204e3)], both_s: 3.5 },
    Picture { name: "figure 13", cells: [Some(345e3), Some(429e3)], both_s: 7.3 },
    Picture { name: "figure 15, middle", cells: [None, Some(166e3)], both_s: 2.6 },
    Picture { name: "figure 15, right", cells: [None, Some(177e3)], both_s: 2.8 },
];

/// Leaves of the cube with a soft layer: before and after the cut.
pub(super) const LAYERED: [f64; 2] = [83e3, 321e3];
/// Seconds of cutting and a step of the same.
pub(super) const LAYERED_S: f64 = 5.5;

/// Rates of the cycle: uncut, aligned and rotated blades.
pub(super) const RATES: [f64; 3] = [0.66, 0.75, 0.75];

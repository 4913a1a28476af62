//! Keys of bodies of octree cells.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cells of `element = "octree"`. The finest ones are cubes; as many as `cells` of the mesh lie along its longest
/// side. Inside the body they are joined to larger ones.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawOctree {
    /// Number of levels of coarsening: the largest cells are 2^levels finest cells wide. 0 makes all cells
    /// equal.
    #[schemars(range(max = 8), extend("x-next" = "3 or 4 suits most bodies; 0 makes all cells equal"))]
    pub levels: u8,
    /// Level that is simulated. 0 simulates the cells themselves. 1 and 2 simulate composite elements that
    /// are 2 and 4 finest cells wide (Nesme et al. 2009); cuts, surface, probes and materials stay as fine as the
    /// cells. Needs `solver.method` mg-pcg or multigrid.
    #[schemars(range(max = 2), extend("x-next" = "0 for accuracy, 1 or 2 for speed"))]
    pub simulate_level: u8,
    /// Divides cells inside the body while something happens there, and joins them again afterwards. Without it
    /// the cells stay as they are, except along cuts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adapt: Option<RawAdapt>,
}

impl Default for RawOctree {
    fn default() -> Self {
        Self { levels: 3, simulate_level: 0, adapt: None }
    }
}

/// Where cells inside the body are fine: at least one of `distance_m`, `speed_m_s`, `error_sqrt_j`. A cell is
/// divided as soon as one of them asks for it. Cells that were divided are joined again when all of them agree.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawAdapt {
    /// Level that cells are divided down to: they become 2^level finest cells wide. It must be below `levels`.
    #[schemars(range(max = 7), extend("x-next" = "0 divides cells down to the size of those at the surface"))]
    pub level: u8,
    /// Distance of a tool from a deformed cell [m]: below the first number the cell is divided, above the second
    /// cells are joined. It counts from the axis of a capsule, the edge of a blade and the centre of a sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-next" = "two distances such as [0.01, 0.02], the first one smaller"))]
    pub distance_m: Option<[f64; 2]>,
    /// Speed of the material in a cell [m/s]: above the first number the cell is divided, below the second cells
    /// are joined.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-next" = "two speeds such as [0.1, 0.05], the first one larger"))]
    pub speed_m_s: Option<[f64; 2]>,
    /// Estimated error of a cell in the energy norm [√J]: above the first number the cell is divided. Cells are
    /// joined if the joined one would have an error below the second.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-next" = "two errors such as [1e-4, 1e-5], the first one larger"))]
    pub error_sqrt_j: Option<[f64; 2]>,
    /// Cells are adapted every so many steps, by one level at a time.
    #[schemars(range(min = 1, max = 10000), extend("x-next" = "1 follows fast tools, 10 costs less"))]
    pub every_steps: u32,
    /// The error is estimated every so many steps. Estimating it takes about as long as evaluating the forces
    /// in double precision. Default: 5 times `every_steps`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 100000), extend("x-next" = "a few times every_steps"))]
    pub error_every_steps: Option<u32>,
}

impl Default for RawAdapt {
    fn default() -> Self {
        Self {
            level: 0,
            distance_m: None,
            speed_m_s: None,
            error_sqrt_j: None,
            every_steps: 4,
            error_every_steps: None,
        }
    }
}

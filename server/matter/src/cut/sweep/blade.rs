//! Input and result of a cut: the blade sweep, the report, the limits and the errors.

use nalgebra::Vector3;
use thiserror::Error;

use crate::cut::topology::copies::NewCopy;

/// Most segments of one [`BladeSweep`]. A longer path is sent in several sweeps.
pub const MAX_SEGMENTS: usize = 1024;

/// The surface a straight blade sweeps, sampled at successive moments.
///
/// Two successive segments span a quadrilateral, split into two triangles along the diagonal from
/// the first tip to the second heel.
///
/// ```
/// # use nalgebra::Vector3;
/// # use scindo_matter::mesh::{BoxPattern, box_mesh};
/// use scindo_matter::cut::{BladeSweep, CutMesh};
///
/// # let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [3; 3], BoxPattern::Tet6);
/// // A cube of 0.1 m; the blade lies along y and falls through all of it.
/// let mut cube = CutMesh::new(mesh)?;
/// let edge = |z: f64| [Vector3::new(0.05, -0.01, z), Vector3::new(0.05, 0.11, z)];
/// let volume = |cube: &CutMesh| cube.copy_volume().iter().sum::<f64>(); // m³
/// let before = volume(&cube);
/// let blade = BladeSweep { segments: vec![edge(0.11), edge(-0.01)] };
/// let report = cube.sweep(&cube.rest_positions(), &blade, 1)?;
/// assert!(report.elements_cut > 0 && !report.new_copies.is_empty());
/// assert_eq!(cube.components().len(), 2);
/// assert!((volume(&cube) - before).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BladeSweep {
    /// Successive blade positions `[tip, heel]` [m], world coordinates, deformed configuration.
    pub segments: Vec<[Vector3<f64>; 2]>,
}

impl BladeSweep {
    /// Refuses a sweep without geometric meaning: no segment, too many segments, or a coordinate that is not
    /// finite.
    pub fn check(&self) -> Result<(), CutError> {
        if self.segments.is_empty() {
            return Err(CutError::NoSegment);
        }
        if self.segments.len() > MAX_SEGMENTS {
            return Err(CutError::TooManySegments { found: self.segments.len(), limit: MAX_SEGMENTS });
        }
        match self.segments.iter().position(|s| s.iter().flatten().any(|c| !c.is_finite())) {
            Some(segment) => Err(CutError::NonFiniteBlade { segment }),
            None => Ok(()),
        }
    }
}

/// What a sweep did to the topology.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CutReport {
    /// Copies appended to those of the mesh's nodes, in ascending order of their id; then those of nodes that the
    /// element adds, which are numbered after all copies of the mesh's.
    pub new_copies: Vec<NewCopy>,
    /// Elements in which material was separated by this sweep.
    pub elements_cut: usize,
    /// Cut faces opened by this sweep; each shows on both lips.
    pub faces_opened: usize,
    /// Edges that this incision crosses but has not separated yet. The cut lags the blade there by at most
    /// one element.
    pub pending_edges: usize,
    /// Edges left whole because an element or the body reached its cap of fragments.
    pub refused_edges: usize,
    /// Earlier incisions that this sweep goes on with, ascending.
    pub joined: Vec<u32>,
    /// Topology epoch after the sweep.
    pub epoch: u32,
}

/// How far a body may be divided before further cuts by clients are refused.
///
/// Few cuts need a tenth of it: a plane through every element makes six fragments and two pieces of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CutLimits {
    /// Most fragments in all elements together. A sweep that needs more leaves edges whole.
    pub fragments: usize,
    /// Most pieces. A body with more is not cut again.
    pub pieces: usize,
    /// Most node copies. A body with more is not cut again.
    pub copies: usize,
}

impl CutLimits {
    /// No limits.
    pub const NONE: Self = Self { fragments: usize::MAX, pieces: usize::MAX, copies: usize::MAX };

    /// Limits for a mesh of `n_elements` elements and `n_nodes` nodes.
    pub fn of_mesh(n_elements: usize, n_nodes: usize) -> Self {
        Self {
            fragments: 8 * n_elements + 10_000,
            pieces: 3 * n_elements + 4_000,
            copies: 6 * n_nodes + 4_000,
        }
    }

    /// Refuses another sweep through a body that already exceeds a limit.
    pub fn check(&self, fragments: usize, pieces: usize, copies: usize) -> Result<(), CutError> {
        let held = [
            ("fragments", fragments, self.fragments),
            ("pieces", pieces, self.pieces),
            ("copies", copies, self.copies),
        ];
        match held.into_iter().find(|(_, found, limit)| found >= limit) {
            Some((what, found, limit)) => Err(CutError::Full { what, found, limit }),
            None => Ok(()),
        }
    }
}

/// Budget of work, in fragments examined. Counting, unlike a clock, gives the same result on every machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work {
    left: u64,
}

impl Work {
    /// A budget of `fragments` fragments.
    pub fn new(fragments: u64) -> Self {
        Self { left: fragments }
    }

    /// A budget that never runs out.
    pub fn unlimited() -> Self {
        Self { left: u64::MAX }
    }

    /// Whether the budget is used up.
    pub fn is_done(&self) -> bool {
        self.left == 0
    }

    /// Charges `fragments` to the budget, which never falls below zero.
    pub fn book(&mut self, fragments: usize) {
        self.left = self.left.saturating_sub(fragments as u64);
    }
}

/// Why a sweep was refused. The mesh is unchanged.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CutError {
    /// The sweep holds no blade segment.
    #[error("the blade sweep has no segment; give at least one [tip, heel] pair")]
    NoSegment,
    /// The sweep holds too many blade segments.
    #[error("the blade sweep has {found} segments, at most {limit} are allowed; send it in parts")]
    TooManySegments {
        /// Count found.
        found: usize,
        /// Largest count allowed.
        limit: usize,
    },
    /// A blade coordinate is NaN or infinite.
    #[error("blade segment {segment} has a coordinate that is not finite")]
    NonFiniteBlade {
        /// Index of the segment.
        segment: usize,
    },
    /// A copy position is NaN or infinite.
    #[error("copy {copy} is at a position that is not finite; restore the body before cutting it")]
    NonFinitePosition {
        /// Copy id.
        copy: usize,
    },
    /// The position array does not belong to this mesh.
    #[error("{found} positions given for {expected} copies; pass one position per copy")]
    PositionCount {
        /// Length found.
        found: usize,
        /// Number of copies.
        expected: usize,
    },
    /// The body has reached a limit of [`CutLimits`].
    #[error(
        "the body holds {found} {what}, at most {limit} are allowed for cuts by clients; reset it to cut again"
    )]
    Full {
        /// The quantity that reached its limit: `fragments`, `pieces` or `copies`.
        what: &'static str,
        /// Count in the body.
        found: usize,
        /// Largest count allowed.
        limit: usize,
    },
    /// A sweep taken in parts has begun and is not complete.
    #[error("another sweep is under way; it has to end before the next one begins")]
    UnderWay,
    /// Incision id 0 is reserved for the skin.
    #[error("incision id 0 means skin; number incisions from 1")]
    ReservedIncision,
}

//! The tables of cuts: when and where a body is cut, and how.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{RawBody, RawElement, Vec3};

/// A scheduled cut: the sweep of a blade, a path on the skin with a depth, or a whole plane.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["sweep_m"]}, {"required": ["path_m", "depth_m"]},
    {"required": ["plane"]}]))]
pub struct RawCut {
    /// Body that is cut.
    pub body: String,
    /// Simulated time of the cut [s].
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-next" = "0 cuts before the first step"))]
    pub at_s: f64,
    /// Cutting method. It must agree with `cutting.method` of the body, which is also its default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<RawCutMethod>,
    /// Successive positions [tip, heel] of the blade in the deformed body [m]. Together they span the cut
    /// surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 2, max = 1024))]
    pub sweep_m: Option<Vec<[Vec3; 2]>>,
    /// Points near the skin of the deformed body [m]. The incision follows the skin between them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 2, max = 64))]
    pub path_m: Option<Vec<Vec3>>,
    /// Depth of the incision below the skin along `path_m` [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-next" = "only elements that the blade crosses completely open, unless cutting.front = calibrated"))]
    pub depth_m: Option<f64>,
    /// A plane that cuts the deformed body all the way through.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<RawCutPlane>,
}

/// A plane that cuts a body.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawCutPlane {
    /// A point on the plane [m].
    pub point_m: Vec3,
    /// Vector across the plane. It may have any length except zero.
    pub normal: Vec3,
}

/// A cutting method.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawCutMethod {
    /// Elements are split into pieces, and nodes get copies. The mesh itself does not change.
    #[default]
    Xfem,
    /// Nodes are moved onto the sweep, and the mesh is separated along element faces. For `tet4`.
    Snap,
    /// Elements are divided along the sweep, whatever shape results. For `tet4`; a baseline for comparisons.
    Subdivide,
    /// Elements that the sweep touches are removed, with their mass. For `tet4`; a baseline for comparisons.
    Remove,
    /// Cells are unlinked from each other, which divides those along the cut into the finest ones. For
    /// `octree`.
    Links,
}

/// How far a cut goes on ahead of the blade.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawFront {
    /// Not at all.
    Behind,
    /// By a share of the size of elements that makes up for those that do not open.
    Calibrated,
}

/// How cuts act on a body.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawCutting {
    /// Cutting method: inside elements (`xfem`), along element faces (`snap`) or between cells (`links`). Baselines for
    /// comparisons divide elements (`subdivide`) or remove them (`remove`).
    /// Default: `links` for `octree`, otherwise `xfem`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<RawCutMethod>,
    /// How far a cut runs ahead of the blade. `behind`: not at all; no element is cut before the blade has left it,
    /// which makes the body too stiff. `calibrated`: by a share of the element size that compensates for elements at the
    /// front that do not open; for `tet4` with the method `xfem`, without `toughness_j_m2`. Many small strokes end, on
    /// average, within a tenth of a cell of where one long stroke ends. Default: `behind`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub front: Option<RawFront>,
    /// Whether a part that a cut separates from all held nodes moves freely or stays in place. `pinned` needs
    /// the method `snap`.
    pub loose: RawLoose,
    /// Which nodes of the cut surface the method `snap` moves onto the sweep. Default: `sound`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moves: Option<RawMoves>,
    /// Whether the method `snap` removes degenerate elements by splits and collapses. Default: true.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clean: Option<bool>,
    /// Fracture toughness [J/m²]: a blade cuts only where the load on its edge exceeds this much per metre [N/m], and
    /// deforms the body before it does. Without it a blade passes through the body without force.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6, "x-next" = "liver has about 100, skin about 2500"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toughness_j_m2: Option<f64>,
}

impl RawCutMethod {
    /// Whether cuts change the elements of a body.
    pub fn changes_mesh(self) -> bool {
        matches!(self, Self::Snap | Self::Subdivide | Self::Remove)
    }
}

impl RawBody {
    /// How the body is cut.
    pub fn cut_method(&self) -> RawCutMethod {
        self.cutting.method.unwrap_or(match self.element {
            RawElement::Octree => RawCutMethod::Links,
            _ => RawCutMethod::Xfem,
        })
    }
}

/// Which nodes of a cut surface move onto the sweep.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawMoves {
    /// None: the cut follows the faces where they are and is jagged.
    None,
    /// Those whose elements stay well shaped. Elsewhere elements are divided along the sweep.
    #[default]
    Sound,
    /// As many as can without inverting an element. Elements between them are pressed flat and then removed, if `clean`
    /// is not switched off.
    Press,
}

/// What happens to a part without held nodes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawLoose {
    /// It moves freely.
    #[default]
    Free,
    /// It is held in place at the corners of its largest skin face.
    Pinned,
}

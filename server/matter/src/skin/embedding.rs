//! A skin embedded in a body, and its settings.

use super::base::Base;
use super::error::{MAX_DIVISIONS, SkinError, check, check_size};
use super::incision_mark::lift;
use super::laid::own_sheet;
use super::misfit::Misfit;
use super::own::{Kept, OwnSurface};
use super::sheet::{Sheet, SkinShape};
use super::stitch::{Change, SkinJoin, SkinSource};
use crate::cut::{CutMesh, IncisionMark, Surface};

/// Resolution of a skin, and how cuts divide it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SkinSettings {
    /// Parts of each edge of the boundary: n² skin triangles per boundary face.
    pub divisions: usize,
    /// Relative distance in [0, 0.5] within which a corner of a skin triangle is moved onto the cut curve
    /// instead of splitting the triangle. 0 always splits.
    pub snapping: f64,
}

impl Default for SkinSettings {
    fn default() -> Self {
        Self { divisions: 4, snapping: 0.0 }
    }
}

/// A skin, and the surface that it makes together with the lips.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Skin {
    settings: SkinSettings,
    base: Base,
    /// The skin before all cuts, for a reset.
    uncut: Sheet,
    sheet: Sheet,
    join: SkinJoin,
    surface: Surface,
    epoch: u32,
    misfit: Option<Misfit>,
    kept: Option<Kept>,
}

impl Skin {
    /// Puts a skin on an uncut body. `shape` returns the rest position [m] of the skin for a point of the
    /// boundary [m] and its unit normal. The identity follows the boundary.
    ///
    /// A skin with an `own` surface consists of its triangles, divided by the edges of the boundary; the divisions
    /// in the settings do not count then. Only where the surface and the boundary do not go together the skin rests
    /// where `shape` says.
    pub fn new(
        cut: &CutMesh,
        settings: SkinSettings,
        own: Option<&OwnSurface<'_>>,
        shape: &mut SkinShape<'_>,
    ) -> Result<Self, SkinError> {
        let SkinSettings { divisions, snapping } = settings;
        if !(1..=MAX_DIVISIONS).contains(&divisions) {
            return Err(SkinError::Divisions { found: divisions });
        }
        if !(0.0..=0.5).contains(&snapping) {
            return Err(SkinError::Snapping { found: snapping });
        }
        if cut.pieces().len() != cut.mesh().tets.len() || cut.fragments.tets.len() != cut.mesh().tets.len() {
            return Err(SkinError::AlreadyCut);
        }
        let base = Base::new(cut.mesh(), &cut.fragments);
        let (sheet, kept) = match own {
            Some(own) => {
                let (sheet, kept) = own_sheet(&base, &cut.mesh().nodes, own, shape)?;
                (sheet, Some(kept))
            }
            None => {
                check_size(base.faces.len() * divisions * divisions)?;
                (Sheet::new(&base, &cut.mesh().nodes, divisions, shape), None)
            }
        };
        check(&sheet)?;
        let mut skin = Self {
            settings,
            base,
            uncut: sheet.clone(),
            sheet,
            join: SkinJoin::default(),
            surface: Surface::default(),
            epoch: cut.epoch(),
            misfit: None,
            kept,
        };
        skin.sew_anew(cut);
        Ok(skin)
    }

    /// Updates the skin after a cut or a reset of the body. The cost depends on what the last cut changed, as
    /// long as this is called after every cut.
    pub fn follow(&mut self, cut: &CutMesh) {
        if self.epoch == cut.epoch() {
            return;
        }
        let told = self.epoch + 1 == cut.epoch() && !cut.changed_fragments().is_empty();
        self.epoch = cut.epoch();
        if cut.fragments.tets.len() == cut.mesh().tets.len() && cut.pieces().len() == cut.mesh().tets.len() {
            self.sheet.clone_from(&self.uncut);
            self.misfit = None;
            self.sew_anew(cut);
        } else if told {
            self.sew(cut, Change { fragments: cut.changed_fragments(), pieces: cut.changed_pieces() });
        } else {
            self.sew_anew(cut);
        }
    }

    /// Adopts the epoch of a body that returned to an earlier state, together with the skin of that state.
    pub fn set_epoch(&mut self, epoch: u32) {
        self.epoch = epoch;
    }

    /// Discards the surface and builds it from nothing.
    fn sew_anew(&mut self, cut: &CutMesh) {
        self.join = SkinJoin::default();
        self.surface = Surface::default();
        let fragments: Vec<u32> = (0..cut.fragments.tets.len() as u32).collect();
        let pieces: Vec<u32> = (0..cut.pieces().len() as u32).collect();
        self.sew(cut, Change { fragments: &fragments, pieces: &pieces });
    }

    fn sew(&mut self, cut: &CutMesh, change: Change) {
        if self.misfit.is_none() {
            let snapping = self.settings.snapping;
            let mut source = SkinSource { cut, base: &self.base, sheet: &mut self.sheet, snapping };
            let sewn = self.join.sew(&mut source, change, &mut self.surface);
            self.misfit = match self.sheet.conflicts {
                0 => sewn.err(),
                _ => Some(Misfit::SharedEdge),
            };
        }
        if self.misfit.is_some() {
            self.surface.clone_from(cut.surface());
        }
    }

    /// Makes the next cut find that the skin does not fit. Only tests of that case use it.
    #[doc(hidden)]
    pub fn spoil(&mut self) {
        self.sheet.conflicts += 1;
    }

    /// Numbers of triangles and vertices before doubled edges are divided, and of those edges.
    #[cfg(test)]
    pub fn sizes(&self) -> [usize; 3] {
        self.join.sizes()
    }

    /// The same skin, built from nothing: the reference for its surface.
    #[cfg(test)]
    pub fn sewn_anew(&self, cut: &CutMesh) -> Self {
        let mut other = self.clone();
        other.sew_anew(cut);
        other
    }

    /// Skin and lips, closed and 2-manifold.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Lines that incisions have drawn on skin and lips without opening them, on the triangles of the
    /// [`surface`](Self::surface).
    pub fn incision_marks(&self, cut: &CutMesh) -> Vec<IncisionMark> {
        if self.misfit.is_some() {
            return cut.incision_marks();
        }
        let mut marks = Vec::new();
        for line in cut.trace_lines() {
            lift(&self.base, &self.sheet, (&self.join, &self.surface), cut, &line, &mut marks);
        }
        marks
    }

    /// Whether skin and lips could be joined. If not, the surface is the boundary of the elements.
    pub fn fits(&self) -> bool {
        self.misfit.is_none()
    }

    /// Why skin and lips could not be joined, if so.
    pub fn misfit(&self) -> Option<Misfit> {
        self.misfit
    }

    /// How much of its own surface the skin consists of, if it has one.
    pub fn kept(&self) -> Option<Kept> {
        self.kept
    }

    /// Number of skin triangles that the last cut renewed. All others stayed unchanged.
    pub fn renewed(&self) -> usize {
        self.join.renewed()
    }

    /// Resolution and way of cutting, as given at creation.
    pub fn settings(&self) -> SkinSettings {
        self.settings
    }
}

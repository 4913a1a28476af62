//! Why a skin cannot be made.

use thiserror::Error;

use super::sheet::Sheet;

/// Most parts into which an edge of an element is divided.
pub(super) const MAX_DIVISIONS: usize = 32;
/// Most skin triangles of one body: a bound on memory.
const MAX_TRIANGLES: usize = 4_000_000;

/// Why no skin could be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SkinError {
    /// The number of divisions is out of range.
    #[error("a skin cannot divide edges of elements into {found} parts; allowed are 1 to {MAX_DIVISIONS}")]
    Divisions {
        /// Number requested.
        found: usize,
    },
    /// The skin would have too many triangles.
    #[error(
        "the skin would have {found} triangles, at most {MAX_TRIANGLES} are allowed; use fewer divisions or a coarser surface"
    )]
    TooFine {
        /// Number requested.
        found: usize,
    },
    /// The snapping distance is out of range.
    #[error("the snapping distance of a skin is {found}; allowed are fractions of an edge from 0 to 0.5")]
    Snapping {
        /// Distance requested.
        found: f64,
    },
    /// The body has already been cut.
    #[error("only an uncut body can be given a skin; reset the body first")]
    AlreadyCut,
    /// The shape function returned a position that is not finite.
    #[error("skin point {point} has a coordinate that is not finite")]
    NonFinitePlace {
        /// Index of the point.
        point: usize,
    },
}

/// Refuses a skin with this many triangles if they are too many.
pub(super) fn check_size(found: usize) -> Result<(), SkinError> {
    if found > MAX_TRIANGLES { Err(SkinError::TooFine { found }) } else { Ok(()) }
}

/// Refuses a skin with too many triangles, and with points that rest nowhere.
pub(super) fn check(sheet: &Sheet) -> Result<(), SkinError> {
    check_size(sheet.corners.len())?;
    match sheet.points.iter().position(|p| !p.place.iter().all(|c| c.is_finite())) {
        Some(point) => Err(SkinError::NonFinitePlace { point }),
        None => Ok(()),
    }
}

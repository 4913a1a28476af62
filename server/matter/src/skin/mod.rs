//! A skin finer than the elements. It is displayed and touched in place of the elements' boundary, and cut
//! with the body.
//!
//! 1. [`Base`]: the boundary faces of the *uncut* mesh. Each skin triangle lies over one of them. Every skin
//!    point has coordinates on the boundary and a rest position of its own, which may lie off the boundary,
//!    on the surface from which the mesh was made.
//! 2. [`Sheet`]: the skin triangles, of any resolution. The *cut curve* consists of the edges between a
//!    boundary face that is skin and one that is a lip. Where fragments opened, it is inserted into the skin:
//!    its vertices become skin points, its edges chains of skin edges. Triangles are split along it or, with
//!    `snapping`, their corners move onto it. Positions are interpolated, so splitting changes no shape.
//!    Triangles that do not meet the curve stay as they are.
//!    The skin of a surface with triangles of its own is [divided along their edges](overlay) instead, and
//!    [rests on them](patch). Such a surface can also be [laid] on another one than the boundary of tetrahedra.
//! 3. [`stitch`]: skin triangles and lips become one surface. An edge of the cut curve joins its chain of
//!    skin edges to the fragment face of the lip, whose border corners move to the skin. Surface vertices are
//!    cycles of corners, so the result is closed and 2-manifold by construction. Both lips of a fresh cut
//!    have the same triangles, so the enclosed volume stays the same.
//! 4. Each surface vertex is bound to a piece beside it: by the barycentric coordinates of its rest position
//!    in that element (extrapolated where it lies outside), on the piece's copies.
//!
//! # Source
//! Jeřábková 2007, 4.1.1–4.1.3 (embedded geometry; splitting, snapping, wound faces); Sifakis, Der,
//! Fedkiw 2007 (embedded surfaces cut with their fragments).

mod base;
mod sheet;
mod error;
mod own;
mod pen;
mod overlay;
mod patch;
mod laid;
mod insert;
mod walk;
mod misfit;
mod lips;
mod stitch;
mod incision_mark;
mod embedding;
mod incision;

pub use embedding::{Skin, SkinSettings};
pub use error::SkinError;
pub use incision::{Penetration, incision};
pub use laid::{Ground, Laid, LaidPoint};
pub use misfit::Misfit;
pub use own::{Kept, Landing, OwnSurface};
pub use sheet::SkinShape;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

//! Rigid things that stand still: floors, tables, posts.
//!
//! An [`Obstacle`] says how far a point is from it and in which direction its surface lies, and where a path first
//! meets it. What bodies do there is the matter of [`contact`](crate::contact).

mod shape;

pub use shape::{Shape, SurfacePlace};

/// A rigid thing that stands still.
#[derive(Debug, Clone)]
pub struct Obstacle {
    /// Name in the scene.
    pub id: String,
    /// What is solid.
    pub shape: Shape,
    /// Coefficient of dry friction μ.
    pub friction: f64,
    /// Stiffness of the contact in multiples of E/h.
    pub stiffness: f64,
}

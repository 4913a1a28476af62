//! Where a ball bears: its pole, and points on rings around it.

/// Rings on a ball: number of points, and radius in radii of the ball.
pub const RINGS: [(usize, f64); 2] = [(6, 0.4), (12, 0.75)];
/// Most bearing points of one tool: the pole of a ball and its rings.
pub const MAX_POINTS: usize = 1 + RINGS[0].0 + RINGS[1].0;

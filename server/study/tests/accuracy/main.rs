//! `scindo accuracy` and `scindo effects` on scenes of a user.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod effects;
mod own_scene;

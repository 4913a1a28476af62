//! The programs as a user runs them.

#![allow(clippy::unwrap_used)]

mod another_scene;
mod bad_input;
mod bad_network;
mod late_viewer;
mod operations;
mod random_scenes;
mod recording;
mod run_scene;

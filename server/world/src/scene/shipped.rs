//! The scenes that come with the program, built into it.

use super::source::{Kind, Node};
use super::{Scene, SceneError, problem};
use crate::format::with_files_inside;
use std::path::PathBuf;

/// A scene that comes with the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShippedScene {
    /// Name on the command line and in `rpc/load`.
    pub name: &'static str,
    text: &'static str,
}

/// Name of the scene that runs when nothing else is asked for.
pub const DEMONSTRATION: &str = "demonstration";

macro_rules! scenes {
    ($($name:literal),* $(,)?) => {
        [$(ShippedScene { name: $name, text: include_str!(concat!("../../scenes/", $name, ".toml")) }),*]
    };
}

/// Every scene that comes with the program: the demonstration, organs, cuts, octree cells, single mechanisms.
pub const SHIPPED: [ShippedScene; 31] = scenes![
    "demonstration",
    "kidney",
    "brain",
    "tendon",
    "diaphragm",
    "vessel",
    "fingertip",
    "tumour",
    "textured-liver",
    "organ-surface",
    "muscle",
    "two-hands",
    "cut-with-force",
    "first-cut",
    "cut-along-faces",
    "half-cut-beam",
    "half-cut-equilibrium",
    "three-cuts",
    "both-elements",
    "probed-block",
    "slices",
    "rods",
    "soft-layer",
    "creeping-strips",
    "swinging-bar",
    "ringing-bar",
    "squeezed-block",
    "tensile-test",
    "bulge-test",
    "relaxing-block",
    "relaxing-cuts",
];

impl ShippedScene {
    /// The scene with this name.
    pub fn of_name(name: &str) -> Option<Self> {
        SHIPPED.into_iter().find(|scene| scene.name == name)
    }

    /// The name most like `name`.
    pub fn nearest(name: &str) -> Option<String> {
        problem::nearest_word(name, SHIPPED.iter().map(|scene| scene.name))
    }

    /// What it shows, in one sentence.
    pub fn description(&self) -> String {
        let tree = Node::from_toml(self.text);
        match tree.as_ref().ok().and_then(|tree| tree.get("description")).map(|node| &node.kind) {
            Some(Kind::Text(text)) => text.clone(),
            _ => String::new(),
        }
    }

    /// Reads and checks it. Its files are inside the program; other paths are relative to the working directory.
    ///
    /// # Errors
    /// Overrides that lead nowhere or out of range.
    pub fn read(&self, overrides: &[String]) -> Result<Scene, SceneError> {
        let tree = Node::from_toml(&with_files_inside(self.text));
        Scene::from_tree(self.name.to_owned(), PathBuf::new(), tree, overrides)
    }
}

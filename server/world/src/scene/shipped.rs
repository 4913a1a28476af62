//! The scenes that come with the program, built into it.

use super::source::Node;
use super::{Scene, SceneError, problem};
use std::path::PathBuf;

/// A scene that comes with the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShippedScene {
    /// Name on the command line and in `rpc/load`.
    pub name: &'static str,
    /// What happens in it, in one line.
    pub description: &'static str,
    text: &'static str,
}

/// Name of the scene that runs when nothing else is asked for.
pub const DEMONSTRATION: &str = "demonstration";

macro_rules! scene {
    ($name:literal, $description:literal) => {
        ShippedScene {
            name: $name,
            description: $description,
            text: include_str!(concat!("../../scenes/", $name, ".toml")),
        }
    };
}

/// Every scene that comes with the program, the demonstration first.
pub const SHIPPED: [ShippedScene; 7] = [
    scene!("demonstration", "An organ under tension is pressed by a finger and cut by a scalpel"),
    scene!("kidney", "A growth on a kidney is undercut by a blade and lifted with forceps"),
    scene!("brain", "A soft folded lobe is cut along its top and held open by two retractors"),
    scene!("tendon", "A muscle under tension loses one of its three strands, cut along element faces"),
    scene!("diaphragm", "A thin dome is pushed in, springs back and is slit beside its opening"),
    scene!("vessel", "The fork of a stretched blood vessel is slit and gapes (neo-Hookean)"),
    scene!("fingertip", "A rod rolls over a finger's pad, nearly incompressible, around a bone"),
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

    /// Reads and checks it.
    ///
    /// # Errors
    /// Overrides that lead nowhere or out of range.
    pub fn read(&self, overrides: &[String]) -> Result<Scene, SceneError> {
        Scene::from_tree(self.name.to_owned(), PathBuf::new(), Node::from_toml(self.text), overrides)
    }
}

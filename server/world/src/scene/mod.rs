//! Scene files: TOML or JSON in, checked objects out.
//!
//! Two stages. The text becomes a tree that remembers its lines ([`source`]); the tree is held
//! against the schema generated from the types of [`raw`]; what fits is turned into ready
//! objects ([`checked`]) while values that must agree with each other are compared. All
//! problems of both stages are collected and reported together.

mod source;

pub mod raw;

pub mod problem;

mod schema;

mod mechanics;

mod course;

pub mod checked;

mod check;

pub mod live;

mod shipped;

use std::path::{Path, PathBuf};

pub use checked::{
    AdaptSpec, BodySpec, CellSplit, CheckedScene, CutPath, CutSpec, EffectSwitches, FixSpec, LoadKind,
    LoadSpec, LookSpec, MaterialPlace, MaterialSpec, MeshSource, ObstacleSpec, OctreeSpec, PathPoint,
    ProbeSpec, PublishRates, Region, Share, SkinSpec, Solid, TextureMapping, TextureSpec, ToolSpec,
};
pub use course::Course;
pub use live::{BodyKey, LiveKey, LiveParameter, LiveValue};
pub use mechanics::{Mechanics, Newmark};
pub use problem::{Fault, Place, Problem, SceneError};
pub use schema::{json_schema, key_reference};
pub use shipped::{DEMONSTRATION, SHIPPED, ShippedScene};

use source::{Node, Unreadable};

/// A scene that has been read and checked.
///
/// ```
/// use scindo_world::scene::Scene;
///
/// let text = r#"
/// schema = 1
/// name = "a block"
/// [[body]]
/// id = "block"
/// mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [2, 2, 2] } }
/// young_pa = 1e4
/// poisson = 0.4
/// density_kg_m3 = 1000
/// "#;
/// let scene = Scene::from_toml(text)?;
/// assert_eq!(scene.name(), "a block");
/// let stiffer = scene.apply_set("body.block.young_pa=3e4")?;
/// assert_eq!(stiffer.checked().bodies[0].young_pa, 3e4);
///
/// // A mistake says what, where, and what is allowed.
/// let mistake = Scene::from_toml(&text.replace("0.4", "0.6")).unwrap_err();
/// assert!(mistake.to_string().contains("poisson"), "{mistake}");
/// # Ok::<(), scindo_world::scene::SceneError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Scene {
    file: String,
    base_dir: PathBuf,
    tree: Node,
    checked: CheckedScene,
}

impl Scene {
    /// Reads a scene file; `.json` is read as JSON, everything else as TOML. Paths in the scene
    /// are relative to the file.
    ///
    /// # Errors
    /// Everything that is wrong with the scene, each with file, line and key where known.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Self::load_with(path, &[])
    }

    /// As [`Scene::load`], with overrides `key=value` applied before the check.
    ///
    /// # Errors
    /// As [`Scene::load`], and overrides that lead nowhere.
    pub fn load_with(path: &Path, overrides: &[String]) -> Result<Self, SceneError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| {
            let next = "check the path of the scene file".to_owned();
            single(&file, None, Fault::File { path: file.clone(), reason: error.to_string(), next })
        })?;
        let base_dir = path.parent().map(Path::to_path_buf).unwrap_or_default();
        let json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
        let tree = if json { Node::from_json(&text) } else { Node::from_toml(&text) };
        Self::from_tree(file, base_dir, tree, overrides)
    }

    /// Reads a scene from TOML text; paths in it are relative to the working directory.
    ///
    /// # Errors
    /// Everything that is wrong with the scene.
    pub fn from_toml(text: &str) -> Result<Self, SceneError> {
        Self::from_tree("scene".into(), PathBuf::new(), Node::from_toml(text), &[])
    }

    /// Reads a scene from JSON text, the same tree as in TOML.
    ///
    /// # Errors
    /// Everything that is wrong with the scene.
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        Self::from_tree("scene".into(), PathBuf::new(), Node::from_json(text), &[])
    }

    /// Reads a scene from JSON text as if it stood in `file`; paths in it are relative to `base_dir`.
    ///
    /// # Errors
    /// Everything that is wrong with the scene.
    pub fn from_json_in(text: &str, file: &str, base_dir: &Path) -> Result<Self, SceneError> {
        Self::from_tree(file.into(), base_dir.into(), Node::from_json(text), &[])
    }

    /// The built-in demonstration: an organ-like body under tension that is pressed, then cut.
    ///
    /// # Errors
    /// Overrides that lead nowhere or out of range.
    pub fn demonstration(overrides: &[String]) -> Result<Self, SceneError> {
        shipped::SHIPPED[0].read(overrides)
    }

    /// The same scene with one value changed, for example `body.beam.young_pa=3e4`.
    ///
    /// # Errors
    /// A key path that leads nowhere, or a scene that is no longer valid.
    pub fn apply_set(&self, assignment: &str) -> Result<Self, SceneError> {
        self.apply_sets(std::slice::from_ref(&assignment.to_owned()))
    }

    /// The same scene with several values changed together, checked once.
    ///
    /// # Errors
    /// A key path that leads nowhere, or a scene that is no longer valid.
    pub fn apply_sets(&self, assignments: &[String]) -> Result<Self, SceneError> {
        Self::from_tree(self.file.clone(), self.base_dir.clone(), Ok(self.tree.clone()), assignments)
    }

    fn from_tree(
        file: String,
        base_dir: PathBuf,
        tree: Result<Node, Unreadable>,
        overrides: &[String],
    ) -> Result<Self, SceneError> {
        let mut tree = tree.map_err(|bad| single(&file, bad.line, Fault::Syntax { message: bad.message }))?;
        for assignment in overrides {
            tree.set(assignment)
                .map_err(|bad| single("--set", bad.line, Fault::Syntax { message: bad.message }))?;
        }
        let checked = check::check(&tree).map_err(|findings| located(&file, &tree, findings))?;
        Ok(Self { file, base_dir, tree, checked })
    }

    /// The ready objects.
    pub fn checked(&self) -> &CheckedScene {
        &self.checked
    }

    /// Name of the scene.
    pub fn name(&self) -> &str {
        &self.checked.name
    }

    /// What the scene shows, in one sentence; empty if it does not say.
    pub fn description(&self) -> &str {
        &self.checked.description
    }

    /// The file it came from.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Where relative paths of the scene start.
    pub fn base_dir(&self) -> &Path {
        &self.base_dir
    }

    /// The JSON Schema of scene files.
    pub fn json_schema() -> serde_json::Value {
        json_schema()
    }

    /// Puts findings of later stages at their lines.
    pub(crate) fn located(&self, findings: Vec<(String, Fault)>) -> SceneError {
        located(&self.file, &self.tree, findings)
    }

    /// The scene as the JSON tree it was read from, overrides included.
    pub fn to_json(&self) -> serde_json::Value {
        self.tree.to_json()
    }
}

fn single(file: &str, line: Option<usize>, fault: Fault) -> SceneError {
    let place = Place { file: file.to_owned(), line, key: String::new() };
    SceneError { problems: vec![Problem { place, fault }] }
}

fn located(file: &str, tree: &Node, findings: Vec<(String, Fault)>) -> SceneError {
    let mut problems: Vec<Problem> = findings
        .into_iter()
        .map(|(key, fault)| Problem {
            place: Place { file: file.to_owned(), line: tree.line_of(&key), key },
            fault,
        })
        .collect();
    problems.sort_by_key(|problem| problem.place.line);
    SceneError { problems }
}

//! A hard case, what it is run with, and what came of it.

use scindo_physics::body::{Ablation, Body, BodyError, BodySettings, PcgSettings};
use scindo_physics::cut::CutMesh;
use scindo_physics::material::Material;
use scindo_physics::mesh::{MeshError, TetMesh};

use super::evidence::Evidence;

/// What keeps a case from being run to its end.
pub type Trouble = Box<dyn std::error::Error + Send + Sync>;

/// The body of a case: sets up, runs, measures.
pub type Run = fn(&Setting) -> Result<Evidence, Trouble>;

/// A hard case.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// Its number in the list of hard cases; none for what is shown beside them.
    pub number: Option<u8>,
    /// Name for the command line.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
    /// What is done.
    pub set_up: &'static str,
    /// When it passes.
    pub rule: &'static str,
    /// Where the case comes from.
    pub source: &'static str,
    /// Takes a second or less in a development build.
    pub quick: bool,
    /// How; none if it belongs to a part that is still to come.
    pub run: Option<Run>,
}

/// How a case ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Every figure is within its bound.
    Passed,
    /// At least one is not, or it did not come to its end.
    Failed,
    /// Belongs to a part that is still to come.
    NotYet,
}

impl Status {
    /// For people and programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::NotYet => "not yet",
        }
    }
}

/// A case and what came of it.
#[derive(Debug, Clone)]
pub struct CaseReport {
    /// The case.
    pub case: &'static Case,
    /// How it ended.
    pub status: Status,
    /// Why it did not come to its end.
    pub reason: Option<String>,
    /// What was measured.
    pub evidence: Evidence,
}

impl CaseReport {
    /// Figures out of their bounds, in words; or why there are none.
    pub fn failures(&self) -> Vec<String> {
        let figures = self.evidence.figures.iter().filter(|figure| !figure.holds());
        self.reason.iter().cloned().chain(figures.map(|figure| figure.words())).collect()
    }
}

/// What a case is run with.
#[derive(Debug, Clone, Copy, Default)]
pub struct Setting {
    /// What is taken out of the method: nothing, except in a mutation check.
    pub ablation: Ablation,
}

impl Setting {
    /// A body on the fast path with this tolerance and at most so many iterations.
    ///
    /// # Errors
    /// What the body says.
    pub fn body(
        &self,
        mesh: TetMesh,
        material: Material,
        iterations: u32,
        tolerance: f64,
    ) -> Result<Body, BodyError> {
        let solver = PcgSettings { iterations, tolerance };
        self.with(mesh, material, BodySettings { solver, ..BodySettings::default() })
    }

    /// A body with these settings.
    ///
    /// # Errors
    /// What the body says.
    pub fn with(&self, mesh: TetMesh, material: Material, settings: BodySettings) -> Result<Body, BodyError> {
        Body::new(mesh, material, BodySettings { ablation: self.ablation, ..settings })
    }

    /// A mesh to be cut without mechanics.
    ///
    /// # Errors
    /// What the mesh says.
    pub fn cut_mesh(&self, mesh: TetMesh) -> Result<CutMesh, MeshError> {
        let mut cut = CutMesh::new(mesh)?;
        cut.set_exact(!self.ablation.exact_predicates);
        Ok(cut)
    }
}

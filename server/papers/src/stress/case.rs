//! A hard case, its setting and its outcome.

use std::path::Path;

use scindo_physics::body::{Ablation, Body, BodyError, BodySettings, PcgSettings};
use scindo_physics::cut::CutMesh;
use scindo_physics::material::Material;
use scindo_physics::mesh::{MeshError, TetMesh};
use scindo_world::assemble::BuildOptions;
use scindo_world::contact::ContactAblation;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

use super::evidence::Evidence;
use crate::lab::Trouble;

/// The body of a case: it sets up, runs and measures.
pub type Run = fn(&Setting) -> Result<Evidence, Trouble>;

/// A hard case.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// Number in the list of hard cases; `None` for cases outside that list.
    pub number: Option<u8>,
    /// Name on the command line.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
    /// Description of the set-up and the run.
    pub set_up: &'static str,
    /// Condition under which the case passes.
    pub rule: &'static str,
    /// Origin of the case, such as a paper.
    pub source: &'static str,
    /// Whether the case takes a second or less in a development build.
    pub quick: bool,
    /// Runs the case.
    pub run: Run,
}

/// How a case ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Every figure is within its bound.
    Passed,
    /// At least one figure is out of bounds, or the case did not finish.
    Failed,
}

impl Status {
    /// Stable name for people and programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
        }
    }
}

/// A case and its outcome.
#[derive(Debug, Clone)]
pub struct CaseReport {
    /// The case that was run.
    pub case: &'static Case,
    /// How it ended.
    pub status: Status,
    /// Reason why the case did not finish.
    pub reason: Option<String>,
    /// Figures, charts and pictures of the run.
    pub evidence: Evidence,
}

impl CaseReport {
    /// Figures out of bounds, in words; or the reason why there are none.
    pub fn failures(&self) -> Vec<String> {
        let figures = self.evidence.figures.iter().filter(|figure| !figure.holds());
        self.reason.iter().cloned().chain(figures.map(|figure| figure.words())).collect()
    }
}

/// The conditions of a run.
#[derive(Debug, Clone, Copy, Default)]
pub struct Setting {
    /// Parts taken out of the method: none, except in a mutation check.
    pub ablation: Ablation,
    /// The same of contact.
    pub contact: ContactAblation,
    /// Whether haptic clients go without their energy tank.
    pub open_tank: bool,
    /// Whether cases that have a long form take it.
    pub long: bool,
}

impl Setting {
    /// Starts a scene, stepped by so many threads.
    ///
    /// # Errors
    /// The scene has a mistake, or cannot be built.
    pub fn scene(&self, text: &str, threads: usize) -> Result<Simulation, Trouble> {
        let options = BuildOptions { threads, portable: false };
        let mut simulation = Simulation::with_options(&Scene::from_toml(text)?, Path::new(""), options)?;
        if (self.ablation, self.contact) != Default::default() {
            simulation.ablate(self.ablation, self.contact)?;
        }
        Ok(simulation)
    }

    /// Builds a body on the fast path with this tolerance and at most this many iterations.
    ///
    /// # Errors
    /// The body refuses the mesh or a setting.
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

    /// Builds a body with these settings.
    ///
    /// # Errors
    /// The body refuses the mesh or a setting.
    pub fn with(&self, mesh: TetMesh, material: Material, settings: BodySettings) -> Result<Body, BodyError> {
        Body::new(mesh, material, BodySettings { ablation: self.ablation, ..settings })
    }

    /// Builds a mesh that is cut without mechanics.
    ///
    /// # Errors
    /// The mesh is invalid.
    pub fn cut_mesh(&self, mesh: TetMesh) -> Result<CutMesh, MeshError> {
        let mut cut = CutMesh::new(mesh)?;
        cut.set_exact(!self.ablation.exact_predicates);
        Ok(cut)
    }
}

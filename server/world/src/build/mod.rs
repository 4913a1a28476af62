//! From checked objects to bodies: meshes opened, nodes selected, forces shared, probes bound.

pub mod region;

pub mod mechanics;

mod mesh;

mod skin;

use std::path::Path;

use scindo_physics::body::{Body, BodyError, BodySettings};
use scindo_physics::material::{Material, Rayleigh};

use crate::probe::Probe;
use crate::scene::{BodySpec, CheckedScene, Fault, FixSpec, LoadSpec, Scene, SceneError, Share};
use crate::simulation::SimBody;

/// How bodies are computed; belongs to the machine, not to the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuildOptions {
    /// Threads that work on a step.
    pub threads: usize,
    /// Use only instructions that every machine has, for the same bits everywhere.
    pub portable: bool,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { threads: 1, portable: false }
    }
}

/// What a scene is made of.
#[derive(Debug)]
pub struct Built {
    /// Bodies in the order of the scene.
    pub bodies: Vec<SimBody>,
    /// Probes in the order of the scene.
    pub probes: Vec<Probe>,
    /// What is odd but allowed.
    pub warnings: Vec<String>,
}

type Finding = (String, Fault);

/// Builds everything, or says everything that stands in the way.
pub fn build(scene: &Scene, base_dir: &Path, options: BuildOptions) -> Result<Built, SceneError> {
    let checked = scene.checked();
    let mut builder = Builder { base_dir, options, findings: Vec::new(), warnings: Vec::new() };
    let bodies: Vec<Option<SimBody>> = checked.bodies.iter().map(|spec| builder.body(spec)).collect();
    let probes = builder.probes(checked, &bodies);
    if builder.findings.is_empty() {
        Ok(Built { bodies: bodies.into_iter().flatten().collect(), probes, warnings: builder.warnings })
    } else {
        Err(scene.located(builder.findings))
    }
}

struct Builder<'a> {
    base_dir: &'a Path,
    options: BuildOptions,
    findings: Vec<Finding>,
    warnings: Vec<String>,
}

impl Builder<'_> {
    fn body(&mut self, spec: &BodySpec) -> Option<SimBody> {
        let at = format!("body.{}", spec.id);
        let mesh::Opened { mesh, health } = match mesh::open(&spec.mesh, self.base_dir) {
            Ok(opened) => opened,
            Err(fault) => {
                self.findings.push((format!("{at}.mesh"), fault));
                return None;
            }
        };
        let doubts = mesh::doubts_about_scale(mesh.bounds(), spec);
        self.warnings.extend(doubts.into_iter().map(|doubt| format!("{at}: {doubt}")));
        let settings = BodySettings {
            threads: self.options.threads,
            portable: self.options.portable,
            ..mechanics::settings(&spec.mechanics)
        };
        let made = match mesh {
            mesh::Mesh::Tets(mesh) => Body::new(mesh, material(spec), settings),
            mesh::Mesh::Hexes(mesh) => Body::hex8(mesh, material(spec), settings),
        };
        let mut body = match made {
            Ok(body) => body,
            Err(error) => {
                self.refused(&format!("{at}.mesh"), &error);
                return None;
            }
        };
        if let Some(skin) = &spec.skin
            && let Err(fault) = skin::put_on(&mut body, skin, &spec.mesh, self.base_dir)
        {
            self.findings.push((format!("{at}.skin"), fault));
        }
        let mut body = SimBody::new(&spec.id, body, health);
        for (i, fix) in spec.fixes.iter().enumerate() {
            self.fix(&format!("{at}.fix.{i}"), fix, &mut body);
        }
        for (i, load) in spec.loads.iter().enumerate() {
            self.load(&format!("{at}.load.{i}"), load, &mut body.body);
        }
        Some(body)
    }

    fn refused(&mut self, at: &str, error: &BodyError) {
        self.findings.push((at.to_owned(), Fault::Mesh { reason: error.to_string() }));
    }

    fn fix(&mut self, at: &str, fix: &FixSpec, body: &mut SimBody) {
        let nodes = self.select(at, &fix.region, &body.body);
        if let Err(error) = body.body.fix(&nodes, fix.axes, fix.displacement_m) {
            self.refused(at, &error);
        }
        body.fix_groups.push(nodes);
    }

    fn load(&mut self, at: &str, load: &LoadSpec, body: &mut Body) {
        let nodes = self.select(at, &load.region, body);
        if nodes.is_empty() {
            return;
        }
        let by_area = match load.share {
            Some(Share::Volume) => None,
            _ => Some(body.add_surface_force(&nodes, load.force_n)),
        };
        let result = match (by_area, load.share) {
            (Some(Err(BodyError::NothingSelected { .. })), None) | (None, _) => {
                body.add_volume_force(&nodes, load.force_n)
            }
            (Some(result), _) => result,
        };
        if let Err(error) = result {
            self.refused(at, &error);
        }
    }

    fn select(&mut self, at: &str, region: &crate::scene::Region, body: &Body) -> Vec<u32> {
        let bounds = body.cut_mesh().mesh().bounds();
        let nodes = region::select(body.rest_positions(), bounds, region);
        if nodes.is_empty() {
            let [low, high] = bounds;
            let fault = Fault::EmptySelection { min_m: low.into(), max_m: high.into() };
            self.findings.push((format!("{at}.where"), fault));
        }
        nodes
    }

    fn probes(&mut self, scene: &CheckedScene, bodies: &[Option<SimBody>]) -> Vec<Probe> {
        let mut probes = Vec::new();
        for spec in &scene.probes {
            let Some(body) = &bodies[spec.body] else { continue };
            let side = spec.side.map(|side| side.into_inner());
            match Probe::bind(&spec.id, spec.body, &body.body, spec.point_m, side) {
                Ok(probe) => probes.push(probe),
                Err(outside) => self.findings.push((
                    format!("probe.{}.point_m", spec.id),
                    Fault::OutsideBody {
                        point_m: spec.point_m.into(),
                        nearest_m: outside.nearest_m.into(),
                        distance_m: outside.distance_m,
                    },
                )),
            }
        }
        probes
    }
}

fn material(spec: &BodySpec) -> Material {
    Material {
        young_pa: spec.young_pa,
        poisson: spec.poisson,
        density_kg_m3: spec.density_kg_m3,
        rayleigh: Rayleigh { mass_1_s: spec.damping_mass_1_s, stiffness_s: spec.damping_stiffness_s },
        law: mechanics::law(&spec.mechanics),
    }
}

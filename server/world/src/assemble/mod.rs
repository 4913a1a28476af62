//! From checked objects to bodies: meshes opened, nodes selected, forces shared, probes bound.

pub mod doubts;

pub(crate) mod mesh;

mod obstacles;

mod skin;
mod texture;

mod threads;

use std::path::Path;

use nalgebra::Vector3;
use scindo_physics::assembly::ModelError;
use scindo_physics::body::{Arithmetic, Body, BodyError, BodySettings, Constants};
use scindo_physics::element::Simd;
use scindo_physics::material::{Material, MaterialError, Rayleigh, Regions};
use scindo_physics::mesh::HexMesh;
use scindo_physics::space::OctreeSpace;
use scindo_physics::space::Tets;
use scindo_physics::team::Lead;

use crate::body::{Adaptation, Probe, SimBody, region};
use crate::mesh_in::{MeshHealth, Observer};
use crate::scene::{BodySpec, CheckedScene, Fault, FixSpec, LoadKind, LoadSpec, Scene, SceneError, Share};
use crate::tool::obstacle::Obstacle;

/// How bodies are computed; belongs to the machine, not to the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuildOptions {
    /// Threads that work on a step, all bodies together.
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
    /// Steps the bodies side by side; `None` for one body or one thread.
    pub lead: Option<Lead>,
    /// Obstacles in the order of the scene.
    pub obstacles: Vec<Obstacle>,
    /// Probes in the order of the scene.
    pub probes: Vec<Probe>,
    /// What is odd but allowed.
    pub warnings: Vec<String>,
}

type Finding = (String, Fault);

/// Builds everything, or says everything that stands in the way.
pub fn build(
    scene: &Scene,
    base_dir: &Path,
    options: BuildOptions,
    observer: &Observer<'_>,
) -> Result<Built, SceneError> {
    let checked = scene.checked();
    let mut builder = Builder {
        base_dir,
        options,
        bodies: checked.bodies.len(),
        observer,
        findings: Vec::new(),
        doubts: Vec::new(),
        warnings: Vec::new(),
    };
    let bodies: Vec<Option<SimBody>> = checked.bodies.iter().map(|spec| builder.body(spec)).collect();
    let obstacles = builder.obstacles(checked);
    let probes = builder.probes(checked, &bodies);
    let mut lead = None;
    let mut bodies: Vec<SimBody> = bodies.into_iter().flatten().collect();
    match threads::share(&mut bodies, options.threads) {
        Ok(shared) => lead = shared,
        Err(error) => {
            let (key, fault) = blame(&error);
            builder.findings.push((format!("body{key}"), fault));
        }
    }
    if builder.findings.is_empty() {
        let mut warnings = builder.warnings;
        warnings.extend(builder.doubts.into_iter().map(|(at, doubt)| format!("{at}: {doubt}")));
        warnings.extend(doubts::of(checked, &mut bodies, &obstacles));
        Ok(Built { bodies, lead, obstacles, probes, warnings })
    } else {
        // A body of the wrong size is why regions and probes miss it.
        let doubts = builder.doubts.into_iter();
        builder.findings.extend(doubts.map(|(at, reason)| (format!("{at}.mesh"), Fault::Mesh { reason })));
        Err(scene.located(builder.findings))
    }
}

/// A body of hexahedra with regions of other materials.
fn hexahedra(
    mesh: HexMesh,
    regions: Regions,
    material: Material,
    settings: BodySettings,
) -> Result<Body, BodyError> {
    let mut space = Tets::hexahedra(mesh)?;
    space.set_regions(regions)?;
    Body::of_space(Box::new(space), material, settings)
}

struct Builder<'a> {
    base_dir: &'a Path,
    options: BuildOptions,
    /// Number of bodies in the scene.
    bodies: usize,
    observer: &'a Observer<'a>,
    findings: Vec<Finding>,
    /// Where, and what is odd about the size there.
    doubts: Vec<(String, String)>,
    warnings: Vec<String>,
}

impl Builder<'_> {
    fn body(&mut self, spec: &BodySpec) -> Option<SimBody> {
        let at = format!("body.{}", spec.id);
        let opened = match spec.octree {
            Some(octree) => mesh::fill(spec, octree, self.base_dir, self.observer),
            None => mesh::open(&spec.mesh, self.base_dir, self.observer),
        };
        let mesh::Opened { mut mesh, mut health } = match opened {
            Ok(opened) => opened,
            Err(fault) => {
                self.findings.push((format!("{at}.mesh"), fault));
                return None;
            }
        };
        let repaired = mesh::doubts_about_repair(health.as_ref());
        self.warnings.extend(repaired.map(|doubt| format!("{at}.mesh: {doubt}")));
        // Before the size is judged and nodes are selected, so that crumbs of the mesh do not count.
        if let (true, mesh::Mesh::Tets(tets)) = (spec.largest_part, &mut mesh)
            && let Some(kept) = mesh::keep_largest_part(tets)
        {
            health.iter_mut().for_each(|health| health.keeps_one_part(&kept));
        }
        let doubts = mesh::doubts_about_scale(mesh.bounds(), spec);
        self.doubts.extend(doubts.into_iter().map(|doubt| (at.clone(), doubt)));
        let along = mesh.nodes_along();
        // How many iterations a solve may need depends on the mesh, so settings have to wait for it.
        let settings = BodySettings {
            solver: spec.mechanics.linear_solver(along, spec.poisson),
            threads: threads::of_one_body(self.bodies, self.options.threads),
            simd: if self.options.portable { Simd::Baseline } else { Simd::detect() },
            simulate_level: spec.octree.map_or(0, |octree| octree.simulate_level),
            ..spec.mechanics.body_settings()
        };
        let regions = match self.regions(&at, spec, &mesh, health.as_ref()) {
            Ok(regions) => regions,
            Err((region, fault)) => {
                self.findings.push((format!("{at}.material.{region}"), fault));
                return None;
            }
        };
        let made = match mesh {
            mesh::Mesh::Tets(mesh) => Body::with_regions(mesh, regions, material(spec), settings),
            mesh::Mesh::Hexes(mesh) => hexahedra(mesh, regions, material(spec), settings),
            mesh::Mesh::Octree(octree) => {
                Body::of_space(Box::new(OctreeSpace::new(*octree)), material(spec), settings)
            }
        };
        let mut body = match made {
            Ok(body) => body,
            Err(error) => {
                let (key, fault) = blame(&error);
                self.findings.push((format!("{at}{key}"), fault));
                return None;
            }
        };
        // The settings allow single precision by what they are; only the body has seen its elements.
        let law = spec.mechanics.constitutive_law();
        if settings.arithmetic(law) == Arithmetic::Single && !body.is_fast() {
            let doubt = "most elements are too flat for single precision, so mixed precision is used, which is slower";
            self.warnings.push(format!("{at}.mesh: {doubt}; better-shaped elements would not need it"));
        }
        if let Some(skin) = &spec.skin {
            match skin::put_on(&mut body, skin, &spec.mesh, self.base_dir) {
                Ok(doubt) => self.warnings.extend(doubt.map(|doubt| format!("{at}.skin: {doubt}"))),
                Err(fault) => self.findings.push((format!("{at}.skin"), fault)),
            }
        }
        let mut body = SimBody::new(&spec.id, body, health);
        // After the skin, because an image on triangles of a surface needs these.
        if let Some(texture) = &spec.look.texture {
            let worn = body.body.kept().is_some();
            match texture::load(texture, &spec.mesh, worn, self.base_dir) {
                Ok(texture) => body.texture = Some(texture.into()),
                Err((key, fault)) => self.findings.push((format!("{at}.look.texture.{key}"), fault)),
            }
        }
        body.fixed_iterations = spec.mechanics.fixed_iterations;
        body.sub_steps = spec.mechanics.sub_steps;
        body.displacement = spec.displacement.clone();
        if let Some(adapt) = spec.octree.and_then(|octree| octree.adapt) {
            let held = spec.fixes.iter().map(|fix| fix.region.clone()).collect();
            body.set_adaptation(Adaptation::new(adapt, held));
        }
        for (i, fix) in spec.fixes.iter().enumerate() {
            self.fix(&format!("{at}.fix.{i}"), fix, &mut body);
        }
        for (i, load) in spec.loads.iter().enumerate() {
            self.load(&format!("{at}.load.{i}"), load, &mut body);
        }
        // After all fixes, because held nodes are not thrown.
        body.velocity_m_s = spec.velocity_m_s;
        if let Err(error) = body.throw() {
            self.refused(&format!("{at}.velocity_m_s"), &error);
        }
        Some(body)
    }

    /// Regions of other materials in a mesh of tetrahedra or hexahedra.
    fn regions(
        &mut self,
        at: &str,
        spec: &BodySpec,
        mesh: &mesh::Mesh,
        health: Option<&MeshHealth>,
    ) -> Result<Regions, (usize, Fault)> {
        if spec.materials.is_empty() || spec.octree.is_some() {
            return Ok(Regions::default());
        }
        let groups = health.map_or(&[][..], MeshHealth::groups);
        let regions = mesh::regions(spec, &mesh.centres(), groups, mesh.bounds(), self.base_dir)?;
        let counts = regions.counts();
        let is_empty = |i: &usize| counts.get(*i).is_none_or(|elements| *elements == 0);
        for i in (0..spec.materials.len()).filter(is_empty) {
            self.warnings.push(format!("{at}.material.{i}: {}", doubts::EMPTY_REGION));
        }
        Ok(regions)
    }

    fn refused(&mut self, at: &str, error: &BodyError) {
        self.findings.push((at.to_owned(), Fault::Mesh { reason: error.to_string() }));
    }

    fn fix(&mut self, at: &str, fix: &FixSpec, body: &mut SimBody) {
        let nodes = self.select(at, &fix.region, &body.body);
        if let Err(error) = body.body.fix(&nodes, fix.held, fix.displacement_m) {
            self.refused(at, &error);
        }
        body.fix_groups.push(nodes);
    }

    fn load(&mut self, at: &str, load: &LoadSpec, body: &mut SimBody) {
        let nodes = self.select(at, &load.region, &body.body);
        if nodes.is_empty() {
            return;
        }
        let (force_n, share) = match load.kind {
            LoadKind::Force { force_n, share } => (force_n, share),
            LoadKind::Pressure { pressure_pa } => {
                match body.body.add_pressure(&nodes, pressure_pa) {
                    Ok(()) => body.pressures.push(load.course.clone()),
                    Err(error) => self.refused(at, &error),
                }
                return;
            }
        };
        type Add = fn(&mut Body, &[u32], Vector3<f64>) -> Result<(), BodyError>;
        let (over_area, over_volume): (Add, Add) = match load.course.is_constant() {
            true => (Body::add_surface_force, Body::add_volume_force),
            false => (Body::add_varying_surface_force, Body::add_varying_volume_force),
        };
        let by_area = match share {
            Some(Share::Volume) => None,
            _ => Some(over_area(&mut body.body, &nodes, force_n)),
        };
        let result = match (by_area, share) {
            (Some(Err(BodyError::NothingSelected { .. })), None) | (None, _) => {
                over_volume(&mut body.body, &nodes, force_n)
            }
            (Some(result), _) => result,
        };
        if let Err(error) = result {
            self.refused(at, &error);
        } else if !load.course.is_constant() {
            body.loads.push(load.course.clone());
        }
    }

    fn select(&mut self, at: &str, region: &crate::scene::Region, body: &Body) -> Vec<u32> {
        let bounds = body.bounds();
        let nodes = region::select(body.rest_positions(), bounds, region);
        if nodes.is_empty() {
            let [low, high] = bounds;
            let fault = Fault::EmptySelection { min_m: low.into(), max_m: high.into() };
            self.findings.push((format!("{at}.where"), fault));
        }
        nodes
    }

    fn obstacles(&mut self, scene: &CheckedScene) -> Vec<Obstacle> {
        let mut found = Vec::new();
        for spec in &scene.obstacles {
            match obstacles::open(spec, self.base_dir) {
                Ok(obstacle) => found.push(obstacle),
                Err(fault) => self.findings.push((format!("obstacle.{}.surface.file", spec.id), fault)),
            }
        }
        found
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
        rayleigh: rayleigh(spec),
        law: spec.mechanics.constitutive_law(),
    }
}

/// Constants that may change while the body moves.
pub fn constants(spec: &BodySpec) -> Constants {
    Constants { young_pa: spec.young_pa, poisson: spec.poisson, rayleigh: rayleigh(spec) }
}

fn rayleigh(spec: &BodySpec) -> Rayleigh {
    Rayleigh { mass_1_s: spec.damping_mass_1_s, stiffness_s: spec.damping_stiffness_s }
}

/// The key of a body that is at fault, with the dot before it, and how.
fn blame(error: &BodyError) -> (String, Fault) {
    let material = |MaterialError { quantity, found, range }: &MaterialError| {
        let (found, allowed) = (format!("{found:e}"), format!("{:e} to {:e}", range.start(), range.end()));
        (format!(".{quantity}"), Fault::OutOfRange { found, allowed, next: "change it".into() })
    };
    match error {
        BodyError::Material(error) | BodyError::Model(ModelError::Material(error)) => material(error),
        BodyError::Setting { name, found, allowed } => {
            let (found, allowed) = (found.to_string(), (*allowed).to_owned());
            (format!(".{name}"), Fault::OutOfRange { found, allowed, next: "change it".into() })
        }
        BodyError::Combination { what, with, instead } => {
            let (what, next) = (format!("{what} does not go with {with}"), format!("take {instead}"));
            (String::new(), Fault::Conflict { what, next })
        }
        BodyError::Dynamics(error) => {
            (".newmark".into(), Fault::Conflict { what: error.to_string(), next: "change them".into() })
        }
        BodyError::Model(error @ (ModelError::Remedy { .. } | ModelError::NoSplit { .. })) => {
            (".locking".into(), Fault::Conflict { what: error.to_string(), next: "change it".into() })
        }
        BodyError::Threads(_) => (String::new(), Fault::Mesh { reason: error.to_string() }),
        error => (".mesh".into(), Fault::Mesh { reason: error.to_string() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_out_of_range_is_blamed_on_its_own_key() {
        let range = Material::YOUNG_PA;
        let too_stiff = MaterialError { quantity: "young_pa", found: 1e14, range };
        let (key, fault) = blame(&BodyError::Material(too_stiff));
        assert_eq!(key, ".young_pa");
        assert_eq!(fault.to_string(), "found 1e14, allowed: 1e-6 to 1e13; change it");
        let tolerance = BodyError::Setting { name: "solver.tolerance", found: 2.0, allowed: "0 … 1" };
        assert_eq!(blame(&tolerance).0, ".solver.tolerance");
        let threads = BodyError::Threads(std::io::Error::other("no more"));
        assert_eq!(blame(&threads).0, "", "no key is at fault");
    }
}

//! Coarse copies of a scene: what is too large to be followed until it turns is followed on fewer elements.
//!
//! A copy has the skin of the body's elements, filled with a coarser lattice, and its constraints, loads, cuts and
//! tools. A body of octree cells is filled anew with larger cells, regions of other materials included; the cells
//! of a copy are not adapted. Linear tetrahedra and trilinear cells are too stiff by an error of the order h²: two
//! copies tell its factor, and with it what the mesh of the scene would do.

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, ElementKind, Volumetric};
use scindo_physics::material::Regions;
use scindo_physics::mesh::TetMesh;
use scindo_physics::space::OctreeSpace;
use scindo_physics::space::Tets;

use super::{BodyForecast, Effort, Ending, Run, Source};
use crate::assemble::Built;
use crate::assemble::mesh::{Mesh, fill, regions};
use crate::body::SimBody;
use crate::body::region;
use crate::format::SurfaceMesh;
use crate::mesh_in::lattice_from_surface;
use crate::scene::{BodySpec, MeshSource, OctreeSpec};
use crate::simulation::Simulation;

/// Elements of the two copies.
const ELEMENTS: [f64; 2] = [1_500.0, 6_000.0];
/// How the time is shared between them.
const SHARES: [f64; 2] = [0.3, 0.7];
/// Lattice tetrahedra per cube of the lattice, a third more of them where the lattice meets the surface.
const TETS_PER_CELL: f64 = 16.0;
/// Tetrahedra that take as long as one cell of an octree.
const TETS_PER_LEAF: f64 = 3.0;
/// A copy that lost more of its volume is another body.
const VOLUME: f64 = 0.15;
/// Largest change that the finer copy may suggest for the scene, as a factor.
const FACTOR: f64 = 1.5;

/// Puts what coarse copies do in place of what was only seen in part.
pub(super) fn follow(simulation: &Simulation, bodies: &mut [BodyForecast], growing: &[bool], effort: Effort) {
    let mut seen: Vec<Vec<(f64, BodyForecast)>> = vec![Vec::new(); bodies.len()];
    for (elements, share) in ELEMENTS.into_iter().zip(SHARES) {
        let Some(mut copy) = copy_of(simulation, elements) else { return };
        let effort = Effort { processor_s: share * effort.processor_s, ..effort };
        let mut run = Run::new(&mut copy, effort);
        let ending = run.go(&mut |_| ());
        for (i, body) in run.concluded(ending).bodies.into_iter().enumerate() {
            if ending != Ending::Budget || body.displacement != Source::AtLeast {
                seen[i].push((copy.bodies()[i].cell_m(), body));
            }
        }
    }
    for (i, body) in bodies.iter_mut().enumerate().filter(|(i, _)| growing[*i]) {
        let [(coarse_m, coarse), (fine_m, fine)] = &seen[i][..] else { continue };
        let [u, finer] = [coarse.largest_displacement_m, fine.largest_displacement_m];
        // u(h) = u₀ + c h²
        let slope = (finer - u) / (fine_m * fine_m - coarse_m * coarse_m);
        let own_m = simulation.bodies()[i].cell_m();
        let continued = finer + slope * (own_m * own_m - fine_m * fine_m);
        let largest_m = continued.clamp(finer / FACTOR, finer * FACTOR);
        if largest_m.is_finite() && largest_m > body.largest_displacement_m {
            body.largest_displacement_m = largest_m;
            body.largest_at_s = fine.largest_at_s;
            body.displacement = Source::CoarseCopies;
        }
    }
}

/// The scene with about so many elements per body; none where a body is too thin for that.
fn copy_of(simulation: &Simulation, elements: f64) -> Option<Simulation> {
    let mut scene = simulation.scene().clone();
    scene.probes.clear();
    let mut bodies = Vec::new();
    for (spec, fine) in scene.bodies.iter_mut().zip(simulation.bodies()) {
        spec.skin = None;
        let wanted = BodySettings { solver: fine.body.settings().solver, ..spec.mechanics.body_settings() };
        let mut body = match spec.octree {
            Some(octree) => {
                let base_dir = simulation.source().base_dir();
                let cells = larger_cells(spec, octree, fine, elements / TETS_PER_LEAF);
                let opened = fill(spec, OctreeSpec { cells, ..octree }, base_dir, &|_| ()).ok()?;
                let Mesh::Octree(octree) = opened.mesh else { return None };
                let space = Box::new(OctreeSpace::new(*octree));
                Body::of_space(space, *fine.body.material(), wanted).ok()?
            }
            None => {
                let volumetric = match wanted.volumetric {
                    Volumetric::Selective => Volumetric::Full,
                    other => other,
                };
                let settings = BodySettings { element: ElementKind::Tet4, volumetric, ..wanted };
                let mesh = Mesh::Tets(coarser(&fine.body, elements)?);
                // Groups belong to the elements of a file, which the copy does not have.
                let base_dir = simulation.source().base_dir();
                let found = match spec.materials.is_empty() {
                    true => Regions::default(),
                    false => regions(spec, &mesh.centres(), &[], mesh.bounds(), base_dir).ok()?,
                };
                let Mesh::Tets(mesh) = mesh else { return None };
                Body::with_regions(mesh, found, *fine.body.material(), settings).ok()?
            }
        };
        if (body.rest_volume() / fine.rest_volume_m3 - 1.0).abs() > VOLUME {
            return None;
        }
        if spec.octree.is_none() || hold_regions(&mut body, spec).is_none() {
            hold(&mut body, fine)?;
        }
        load(&mut body, &fine.body)?;
        let mut body = SimBody::new(&spec.id, body, None);
        body.displacement = fine.displacement.clone();
        body.sub_steps = fine.sub_steps;
        bodies.push(body);
    }
    let obstacles = simulation.obstacles().to_vec();
    let built = Built { bodies, lead: None, obstacles, probes: Vec::new(), warnings: Vec::new() };
    Some(Simulation::assemble(simulation.source().clone(), scene, built))
}

/// Finest cells along the longest side of the body `spec`, so that an octree with as many levels has about so many
/// `leaves`; at most those of `fine`. A box is divided without remainder if there is such a number nearby.
fn larger_cells(spec: &BodySpec, octree: OctreeSpec, fine: &SimBody, leaves: f64) -> u32 {
    let now = fine.body.n_elements() as f64;
    if now <= 1.5 * leaves {
        return octree.cells;
    }
    // Leaves are as many as the surface calls for, but no more than cells of equal size would be.
    let along = f64::from(octree.cells);
    let equal = along * fine.cell_m() * (leaves / fine.rest_volume_m3).cbrt();
    let wanted = equal.max(along * (leaves / now).sqrt());
    let nearest = (wanted.round() as u32).clamp(2, octree.cells);
    let MeshSource::Box { cells: n, .. } = &spec.mesh else { return nearest };
    let along = u64::from(octree.cells);
    let divides = |c: &u32| n.iter().all(|&n| (n as u64 * u64::from(*c)).is_multiple_of(along));
    let near = (1..=octree.cells).filter(divides).min_by_key(|c| c.abs_diff(nearest));
    near.filter(|c| 2 * c >= nearest && *c <= 2 * nearest).unwrap_or(nearest)
}

/// Holds what the regions of the scene select in `copy`; `None` if one of them selects nothing.
fn hold_regions(copy: &mut Body, spec: &BodySpec) -> Option<()> {
    let (rest, bounds) = (copy.rest_positions().to_vec(), copy.bounds());
    let groups: Vec<Vec<u32>> =
        spec.fixes.iter().map(|fix| region::select(&rest, bounds, &fix.region)).collect();
    if groups.iter().any(Vec::is_empty) {
        return None;
    }
    for (fix, nodes) in spec.fixes.iter().zip(&groups) {
        copy.fix(nodes, fix.held, fix.displacement_m).ok()?;
    }
    Some(())
}

/// The uncut body with fewer elements, or as it is where it has no more.
fn coarser(body: &Body, elements: f64) -> Option<TetMesh> {
    let mesh = body.tets().map(Tets::mesh);
    if let Some(mesh) = mesh.filter(|mesh| mesh.tets.len() as f64 <= 1.5 * elements) {
        return Some(mesh.clone());
    }
    let volume_m3 = mesh.map_or_else(|| body.rest_volume(), |mesh| mesh.volumes().iter().sum());
    let [low, high] = body.bounds();
    let spacing_m = (TETS_PER_CELL * volume_m3 / elements).cbrt();
    let cells = ((high - low).max() / spacing_m).round().clamp(4.0, 128.0) as usize;
    let (vertices, triangles) = match mesh {
        Some(mesh) => (mesh.nodes.clone(), mesh.boundary_faces().iter().map(|face| face.nodes).collect()),
        // Lips of cuts lie on each other at rest and enclose nothing.
        None => {
            let (surface, rest) = (body.element_surface(), body.rest_positions());
            let vertices = surface.vertices.iter().map(|vertex| vertex.position(rest)).collect();
            (vertices, surface.triangles.clone())
        }
    };
    let skin = SurfaceMesh { file: "copy".into(), vertices, triangles, notes: Vec::new() };
    let (copy, report) = lattice_from_surface(&skin, cells, 1.0).ok()?;
    (report.volume_error.abs() < VOLUME).then_some(copy)
}

/// Holds the nodes of `copy` that lie where nodes of `fine` are held.
fn hold(copy: &mut Body, fine: &SimBody) -> Option<()> {
    let held = fine.body.fixed_nodes();
    let rest = fine.body.rest_positions();
    let at = |i: usize| rest[held[i].node as usize];
    let nodes: Vec<Vector3<f64>> = copy.rest_positions().to_vec();
    let reach = 0.75 * fine.cell_m();
    let mut any = false;
    for (node, x) in (0u32..).zip(&nodes) {
        let Some(nearest) = nearest(x, (0..held.len()).map(at)) else { return Some(()) };
        if (at(nearest) - x).norm() <= reach {
            copy.fix(&[node], held[nearest].held, held[nearest].displacement_m).ok()?;
            any = true;
        }
    }
    if !any {
        for (i, fixed) in held.iter().enumerate() {
            let node = nearest(&at(i), nodes.iter().copied())?;
            copy.fix(&[node as u32], fixed.held, fixed.displacement_m).ok()?;
        }
    }
    Some(())
}

/// Puts the load of every node of `fine`, with the pressure at its present place, on the nearest node of `copy`.
fn load(copy: &mut Body, fine: &Body) -> Option<()> {
    let nodes: Vec<Vector3<f64>> = copy.rest_positions().to_vec();
    let mut forces = vec![Vector3::zeros(); nodes.len()];
    let pressed = fine.present_loads();
    for (x, force) in fine.rest_positions().iter().zip(&pressed).filter(|(_, f)| f.norm() > 0.0) {
        forces[nearest(x, nodes.iter().copied())?] += force;
    }
    for (node, force) in (0u32..).zip(forces).filter(|(_, f)| f.norm() > 0.0) {
        copy.add_nodal_force(node, force).ok()?;
    }
    Some(())
}

fn nearest(x: &Vector3<f64>, points: impl Iterator<Item = Vector3<f64>>) -> Option<usize> {
    points.map(|p| (p - x).norm_squared()).enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::forecast::forecast;
    use crate::scene::Scene;

    /// A block that sags from a wall and is pushed aside, of 12 000 elements.
    const BLOCK: &str = r#"
        schema = 1
        [world]
        gravity_m_s2 = [0, 0, -9.81]
        step_s = 0.02
        [[body]]
        id = "block"
        mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.04, 0.04], cells = [24, 10, 10] } }
        young_pa = 1e5
        poisson = 0.3
        density_kg_m3 = 1000
        solver = { iterations = 400, tolerance = 1e-3 }
        [[body.fix]]
        where = { slab = { axis = "x", from = 0, to = 0 } }
        [[body.load]]
        where = { slab = { axis = "x", from = 1, to = 1 } }
        force_n = [0, 0.2, 0]
    "#;

    #[test]
    fn coarse_copies_move_as_far_as_the_scene() {
        let mut simulation = Simulation::new(&Scene::from_toml(BLOCK).unwrap(), Path::new("")).unwrap();
        let effort = Effort { processor_s: 60.0, end_s: Some(0.16) };
        let seen = forecast(&mut simulation, effort, &mut |_| ()).unwrap().bodies.remove(0);
        assert_eq!(seen.displacement, Source::Steps);
        let nothing = BodyForecast { id: "block".into(), ..BodyForecast::default() };
        let mut foretold = [BodyForecast { displacement: Source::AtLeast, ..nothing }];
        follow(&simulation, &mut foretold, &[true], effort);
        assert_eq!(foretold[0].displacement, Source::CoarseCopies);
        let ratio = foretold[0].largest_displacement_m / seen.largest_displacement_m;
        assert!((0.85..1.15).contains(&ratio), "{ratio}");
    }

    /// A bar of cells, stiff but for a quarter of its length beside the wall, and heavy at its end.
    const BAR: &str = r#"
        schema = 1
        [world]
        gravity_m_s2 = [0, 0, -9.81]
        step_s = 0.02
        [[body]]
        id = "bar"
        element = "octree"
        mesh = { box = { min_m = [0, 0, 0], max_m = [0.08, 0.04, 0.04], cells = [48, 24, 24] } }
        octree = { levels = 2, adapt = { distance_m = [0.01, 0.02] } }
        young_pa = 2e5
        poisson = 0.3
        density_kg_m3 = 1000
        [[body.material]]
        where = { half_space = { point_m = [0.02, 0, 0], normal = [1, 0, 0] } }
        young_pa = 1e7
        [[body.material]]
        where = { half_space = { point_m = [0.06, 0, 0], normal = [1, 0, 0] } }
        young_pa = 1e7
        density_kg_m3 = 4000
        [[body.fix]]
        where = { slab = { axis = "x", from = 0, to = 0 } }
    "#;

    #[test]
    fn copies_of_cells_are_cells_with_the_same_regions() {
        let mut simulation = Simulation::new(&Scene::from_toml(BAR).unwrap(), Path::new("")).unwrap();
        let fine = &simulation.bodies()[0].body;
        let (mass, n) = (fine.total_mass(), fine.n_elements());
        for elements in ELEMENTS {
            let copy = copy_of(&simulation, elements).unwrap();
            let body = &copy.bodies()[0].body;
            assert_eq!(body.settings().element, ElementKind::Octree);
            assert_eq!(body.settings().method, scindo_physics::body::Method::MgPcg);
            let leaves = body.n_elements() as f64;
            let wanted = elements / TETS_PER_LEAF;
            assert!(leaves < n as f64 && leaves > 0.3 * wanted && leaves < 3.0 * wanted, "{leaves} {wanted}");
            // The planes between the materials lie between cells of every copy.
            assert!((body.total_mass() / mass - 1.0).abs() < 1e-9, "{}", body.total_mass());
            assert!(!body.fixed_nodes().is_empty());
            assert!(body.fixed_nodes().iter().all(|held| body.rest_positions()[held.node as usize].x == 0.0));
        }
        let effort = Effort { processor_s: 60.0, end_s: Some(0.1) };
        let seen = forecast(&mut simulation, effort, &mut |_| ()).unwrap().bodies.remove(0);
        let nothing = BodyForecast { id: "bar".into(), ..BodyForecast::default() };
        let mut foretold = [BodyForecast { displacement: Source::AtLeast, ..nothing }];
        follow(&simulation, &mut foretold, &[true], effort);
        assert_eq!(foretold[0].displacement, Source::CoarseCopies);
        let ratio = foretold[0].largest_displacement_m / seen.largest_displacement_m;
        assert!((0.9..1.1).contains(&ratio), "{ratio}");
    }
}

//! Octrees whose skin is the triangles of a surface, through every change that a space goes through.

use nalgebra::Vector3;
use scindo_physics::cut::{BladeSweep, Surface};
use scindo_physics::octree::{BoxShape, Family, Octree, OctreeSettings};
use scindo_physics::skin::{Landing, OwnSurface, SkinError, SkinSettings};
use scindo_physics::space::{OctreeSpace, Space};
use scindo_physics::team::Team;

/// A unit cube of cells, its leaves up to four finest cells wide. An odd number of cells leaves cells of the boundary with
/// hanging vertices.
fn cube() -> OctreeSpace {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let settings = OctreeSettings { cells: 15, levels: 2 };
    OctreeSpace::new(Octree::fill(&shape, settings, &|_| 0).unwrap())
}

/// Gives a space its own boundary as a skin, `scale` times as large about the middle of the cube.
fn wear(space: &mut OctreeSpace, scale: f64) -> Result<(), SkinError> {
    let (ground, triangles) = space.skin_ground();
    let middle = Vector3::repeat(0.5);
    let vertices: Vec<Vector3<f64>> = ground.iter().map(|X| middle + scale * (X - middle)).collect();
    let mut landings = vec![None; vertices.len()];
    for nodes in &triangles {
        for k in 0..3 {
            let mut weights = [0.0; 3];
            weights[k] = 1.0;
            landings[nodes[k] as usize] = Some(Landing { nodes: *nodes, weights });
        }
    }
    let own = OwnSurface { vertices: &vertices, triangles: &triangles, landings: &landings };
    space.put_on_skin(SkinSettings::default(), Some(&own), &mut |X, _| *X)
}

/// A motion that no coarse cell can follow.
fn bend(X: &Vector3<f64>) -> Vector3<f64> {
    X + 0.05 * Vector3::new((9.0 * X.y).sin(), (7.0 * X.z).cos(), (8.0 * X.x).sin())
}

/// The places of the corners of all triangles with the vertices of cells at `x` [m], bit for bit, in ascending order.
fn places(surface: &Surface, x: &[Vector3<f64>]) -> Vec<[[u64; 3]; 3]> {
    let place =
        |v: &u32| <[f64; 3]>::from(surface.vertices[*v as usize].position(x)).map(|c| (c + 0.0).to_bits());
    let mut all: Vec<_> =
        surface.triangles.iter().map(|t| [place(&t[0]), place(&t[1]), place(&t[2])]).collect();
    all.iter_mut().for_each(|t| {
        let first = (0..3).min_by_key(|k| t[*k]).unwrap();
        t.rotate_left(first);
    });
    all.sort_unstable();
    all
}

/// Checks that the skin is closed and encloses as many parts as the cells have; returns the volume [m³] that the skin encloses.
fn enclosed(space: &OctreeSpace) -> f64 {
    let flaws = space.flaws();
    assert!(flaws.surface == 0 && flaws.volume < 1e-12, "{flaws:?}");
    let (surface, elements) = (space.surface(), space.element_surface());
    assert_eq!(surface.n_shells(), elements.n_shells());
    assert_eq!(surface.triangles.len(), surface.tags.len());
    surface.volume(&space.rest_positions())
}

#[test]
fn a_skin_of_own_triangles_follows_refinement_cuts_coarsening_and_reset() {
    let mut team = Team::alone();
    for scale in [1.0, 0.99] {
        let mut space = cube();
        let bare = space.surface().triangles.len();
        wear(&mut space, scale).unwrap();
        let kept = space.kept().unwrap();
        assert_eq!((kept.of, kept.triangles), (bare, bare), "{scale}");
        let whole = scale.powi(3);
        assert!((enclosed(&space) - whole).abs() < 1e-12);
        let start = places(space.surface(), &space.rest_positions());

        // Refinement leaves every triangle where it was.
        let cells = space.octree().cells();
        let large: Vec<u32> = (0..cells.len() as u32).filter(|&id| cells[id as usize].level > 0).collect();
        assert!(space.refine(&large).change.divided > 0);
        assert!((enclosed(&space) - whole).abs() < 1e-12);
        // It also ties the skin to the new vertices: a skin that is put on afterwards moves in the same way.
        let mut fresh = OctreeSpace::new(space.octree().clone());
        wear(&mut fresh, scale).unwrap();
        let bent: Vec<Vector3<f64>> = space.rest_positions().iter().map(bend).collect();
        assert!(places(space.surface(), &bent) == places(fresh.surface(), &bent), "{scale}");

        // Cuts take no volume away. Around them, the surface of the cells replaces the skin, which may be smaller.
        let corner = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
        let through = |y: f64| [corner(0.4, y, -0.2), corner(0.47, y, 1.2)];
        let slit = |y: f64| [corner(0.7, y, 1.2), corner(0.8, y, 0.6)];
        let mut shells = Vec::new();
        for (incision, blade) in [(1, [through(-0.2), through(1.2)]), (2, [slit(-0.2), slit(0.6)])] {
            let blade = BladeSweep { segments: blade.to_vec() };
            let x = space.rest_positions();
            space.cut(&mut team, &x, &blade, incision).unwrap();
            let volume = enclosed(&space);
            assert!(volume > whole - 1e-12 && volume < 1.0 + 1e-12, "{scale}: {volume}");
            let tags = &space.surface().tags;
            assert!((1..=incision).all(|tag| tags.contains(&tag)), "{scale}, incision {incision}");
            shells.push(space.surface().n_shells());
        }
        assert_eq!(shells, [2, 2]);

        // Coarsening keeps what the cuts opened.
        let first = space.octree().cells().iter().filter(|cell| cell.octant() == 0);
        let families: Vec<Family> = first.map(|cell| Family { level: cell.level + 1, at: cell.at }).collect();
        let before = enclosed(&space);
        assert!(space.coarsen(&families, &|_, _| false).joined > 0);
        assert!((enclosed(&space) - before).abs() < 1e-12);
        assert!(space.surface().tags.contains(&1) && space.surface().tags.contains(&2));

        // Only an uncut body takes a skin, and reset gives it back as it was.
        assert!(matches!(wear(&mut space, scale), Err(SkinError::AlreadyCut)));
        space.reset().unwrap();
        assert!(places(space.surface(), &space.rest_positions()) == start, "{scale}");
        assert!((enclosed(&space) - whole).abs() < 1e-12);
    }
}

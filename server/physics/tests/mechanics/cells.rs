//! The stiffness of an octree's cells in steady use.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::element::Simd;
use scindo_physics::material::{Lame, Law};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::operator::cells::CellStiffness;
use scindo_physics::operator::{ElasticUpdate, Stiffness, apply};
use scindo_physics::team::Team;

#[test]
fn updates_and_products_do_not_allocate() {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 16, levels: 2 }, &|_| 0).unwrap();
    let mut stiffness = CellStiffness::new(Simd::detect(), &octree, &[]);
    let mut team = Team::new(2).unwrap();
    let mut x = octree.rest_positions();
    let (v, mut y) = (vec![[1.0, 0.5, -0.25, 0.0]; x.len()], vec![[0.0; 4]; x.len()]);
    for law in [Law::Corotational, Law::Linear] {
        let with = ElasticUpdate { lame: Lame { mu: 4e4, lambda: 9e4 }, law, scale: 1e-4 };
        stiffness.update(&mut team, &with, &x, None);
        // The first product with a direction makes room for it.
        stiffness.multiply_direction(&mut team, &v, 0.0);
        let before = allocations();
        for k in 0..3 {
            x.iter_mut().for_each(|x| x.y += 0.01 * (5.0 * x.x + f64::from(k)).sin());
            assert_eq!(stiffness.update(&mut team, &with, &x, None), 0);
            apply(&mut stiffness, &mut team, &v, &mut y);
            stiffness.multiply_direction(&mut team, &v, 0.5);
        }
        assert_eq!(allocations() - before, 0, "{law:?}");
    }
}

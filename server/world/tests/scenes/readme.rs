//! The scene in the README runs as it stands there.

use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

const README: &str = include_str!("../../../../README.md");

#[test]
fn the_scene_of_the_readme_converges_and_its_cut_opens() {
    let blocks: Vec<&str> =
        README.split("```toml\n").skip(1).map(|text| text.split("```").next().unwrap()).collect();
    let scenes: Vec<&str> = blocks.into_iter().filter(|text| text.contains("schema = 1")).collect();
    assert!(!scenes.is_empty());
    for text in scenes {
        let scene = Scene::from_toml(text).unwrap();
        let mut sim = Simulation::new(&scene, scene.base_dir()).unwrap();
        assert_eq!(sim.warnings(), [""; 0]);
        let tolerance = scene.checked().bodies[0].mechanics.tolerance;
        while sim.time_s() < 1.6 {
            let report = sim.step(&Inputs::default());
            let solve = report.bodies[0].solve;
            assert!(solve.residual <= tolerance && solve.inverted_pieces == 0, "{solve:?} in {report:?}");
        }
        let body = &sim.bodies()[0].body;
        assert!(body.surface().tags.contains(&1), "the cut opens");
        assert!(body.parts().free.iter().all(|free| !free), "nothing falls off");
        let [low, high] = body.bounds();
        let moved = body.positions().iter().zip(body.rest_positions()).map(|(x, rest)| (x - rest).norm());
        let most = moved.fold(0.0, f64::max) / (high - low).max();
        assert!((0.005..0.2).contains(&most), "it moves by {most} of its length");
    }
}

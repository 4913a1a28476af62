//! Nienhuys' cantilever (2003, Table 3.1): his errors to the printed digit, and where they lead.

use nalgebra::Vector3;
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::material::Law;
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};

use crate::support::{clamped, equilibrium, material, reference_path};

const LENGTH: f64 = 1.2;
/// Tip deflection [m] of a thin beam: 4 F/(E d) (l/h)³.
const EULER_BERNOULLI: f64 = 8.64e-3;
/// With the shear of the cross section: + F l/(κ G A), κ = 5/6.
const TIMOSHENKO: f64 = 8.784e-3;

fn beam(cells: [usize; 3]) -> TetMesh {
    box_mesh(Vector3::zeros(), Vector3::new(LENGTH, 0.2, 0.3), cells, BoxPattern::Octahedral6)
}

/// Equilibrium with 3 N in −y shared by `weights` over the nodes of the tip face.
fn bent(model: &Model, weights: &[f64]) -> Vec<Vector3<f64>> {
    let total: f64 = weights.iter().sum();
    let loads: Vec<_> = weights.iter().map(|w| Vector3::new(0.0, -3.0 * w / total, 0.0)).collect();
    let fixed = clamped(model, |X| X.x < 1e-9);
    equilibrium(model, &loads, &fixed, model.rest())
}

fn tip_nodes(model: &Model) -> Vec<usize> {
    (0..model.n_nodes()).filter(|&n| model.rest()[n].x > LENGTH - 1e-9).collect()
}

/// Mean deflection [m] of the tip with equal forces on its nodes, and the solution.
fn equal_load(cells: [usize; 3]) -> (f64, Model, Vec<Vector3<f64>>) {
    let model =
        Model::tet4(&beam(cells), &material(1e6, 0.0, 1000.0, Law::Linear), Volumetric::Full).unwrap();
    let tip = tip_nodes(&model);
    let mut weights = vec![0.0; model.n_nodes()];
    tip.iter().for_each(|&n| weights[n] = 1.0);
    let x = bent(&model, &weights);
    let mean = tip.iter().map(|&n| (x[n] - model.rest()[n]).y).sum::<f64>() / tip.len() as f64;
    (mean, model, x)
}

#[test]
fn the_printed_table_is_reproduced() {
    let mut table = csv::Reader::from_path(reference_path("R1/nienhuys.csv")).unwrap();
    let mut meshes = 0;
    for row in table.records().map(Result::unwrap).filter(|row| &row[3] == "equal") {
        let number = |column: usize| row[column].parse::<f64>().unwrap();
        let cells: Vec<usize> = row[0].split('x').map(|n| n.parse().unwrap()).collect();
        let (mean, model, x) = equal_load([cells[0], cells[1], cells[2]]);
        let error = 100.0 * (1.0 - mean.abs() / EULER_BERNOULLI);
        println!("{}: tip {mean:.10} m, {error:.4} % (printed {})", &row[0], &row[4]);
        assert_eq!(model.n_nodes() as f64, number(1));
        assert_eq!(model.n_elements() as f64, number(2));
        assert!((error - number(4)).abs() < 0.05, "the printed digit");
        assert!((mean / number(5) - 1.0).abs() < 2e-8, "the independent solution");
        assert!((model.energy(&x) / number(10) - 1.0).abs() < 1e-7, "its energy");
        meshes += 1;
    }
    assert_eq!(meshes, 5);
}

#[test]
fn every_node_agrees_with_the_independent_solution() {
    let (_, model, x) = equal_load([16, 4, 4]);
    let mut nodes = csv::Reader::from_path(reference_path("R1/nodes_16x4x4.csv")).unwrap();
    for row in nodes.deserialize::<(usize, f64, f64, f64)>() {
        let (n, ux, uy, uz) = row.unwrap();
        let difference = x[n] - model.rest()[n] - Vector3::new(ux, uy, uz);
        assert!(difference.amax() < 1e-11, "node {n}: {difference}");
    }
}

/// The table's "error" does not go to zero: a solid beam bends as Timoshenko says.
#[test]
fn fine_meshes_converge_to_timoshenko() {
    let model = Model::tet10(&beam([16, 4, 4]), &material(1e6, 0.0, 1000.0, Law::Linear)).unwrap();
    // Uniform traction; the rows of corners and middles get what a quadratic face gives them.
    let tip = tip_nodes(&model);
    let mut weights = vec![0.0; model.n_nodes()];
    for e in 0..model.n_elements() {
        let at_tip: Vec<usize> =
            model.element(e).iter().map(|&n| n as usize).filter(|n| tip.contains(n)).collect();
        if at_tip.len() == 6 {
            // ∫ N_a over a quadratic triangle: nothing at corners, a third at each middle.
            let middles = at_tip.iter().filter(|&&n| n >= 17 * 5 * 5);
            middles.for_each(|&n| weights[n] += 1.0);
        }
    }
    let x = bent(&model, &weights);
    let area: f64 = weights.iter().sum();
    let quadratic = tip.iter().map(|&n| weights[n] * (x[n] - model.rest()[n]).y).sum::<f64>().abs() / area;
    let ratio = quadratic / TIMOSHENKO - 1.0;
    let error = |cells| (equal_load(cells).0.abs() / quadratic - 1.0).abs();
    let (coarse, fine) = (error([32, 8, 8]), error([48, 12, 12]));
    let order = (coarse / fine).ln() / 1.5_f64.ln();
    println!("Tet10 {quadratic:.6e} m, {:.4} % from Timoshenko; Tet4 of order {order:.3}", 100.0 * ratio);
    assert!(ratio.abs() < 1e-3);
    assert!(order > 1.75, "{coarse} {fine}");
}

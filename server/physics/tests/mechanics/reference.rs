//! Static solutions against published numbers of an independent implementation on the same mesh.
//!
//! Their residual is 1e-11: what is compared is the implementation, not the discretisation.

use nalgebra::Vector3;
use scindo_physics::body::{Body, StaticSettings};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, bar_mesh, hold_left, left_face, settings};

fn drooping_bar(law: Law) -> Body {
    let mut body = Body::new(bar_mesh(), Material { law, ..SOFT }, settings(10, 1e-3)).unwrap();
    hold_left(&mut body);
    let report = body.solve_static(DOWN, &StaticSettings::default()).unwrap();
    assert!(report.converged, "{report:?}");
    body
}

fn mean_tip(body: &Body) -> Vector3<f64> {
    let nodes = &body.tets().unwrap().mesh().nodes;
    let tip: Vec<usize> = (0..nodes.len()).filter(|&n| nodes[n].x == 1.0).collect();
    tip.iter().map(|&n| body.positions()[n] - nodes[n]).sum::<Vector3<f64>>() / tip.len() as f64
}

#[test]
fn drooping_bar_corotational() {
    let body = drooping_bar(Law::Corotational);
    let tip = mean_tip(&body);
    assert!((tip.y + 0.333_432_806).abs() < 1e-7, "{tip}");
    assert!((tip.x + 0.062_842_915).abs() < 1e-7, "{tip}");
    assert!((body.elastic_energy() - 2.599_131_989).abs() < 1e-6);
    let weight = body.total_mass() * DOWN;
    let clamp = left_face(&body);
    assert!((body.reaction(&clamp, DOWN) + weight).norm() < 1e-6 * weight.norm());
}

#[test]
fn drooping_bar_linear() {
    let body = drooping_bar(Law::Linear);
    let tip = mean_tip(&body);
    assert!((tip.y + 0.362_253_595).abs() < 1e-7 && tip.x.abs() < 1e-7, "{tip}");
    assert!((body.elastic_energy() - 2.901_784_791).abs() < 1e-6);
}

#[test]
fn sideways_beam_before_the_cut() {
    let mesh = box_mesh(
        Vector3::zeros(),
        Vector3::new(0.03, 0.06, 0.2),
        [6, 12, 40],
        BoxPattern::Tet5 { parity: false },
    );
    let clamp: Vec<u32> = (0..mesh.nodes.len() as u32).filter(|&n| mesh.nodes[n as usize].z == 0.0).collect();
    let material = Material {
        young_pa: 3e5,
        poisson: 0.35,
        density_kg_m3: 1070.0,
        rayleigh: Rayleigh::default(),
        law: Law::Corotational,
    };
    let mut body = Body::new(mesh, material, settings(10, 1e-3)).unwrap();
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    let report = body.solve_static(Vector3::new(9.81, 0.0, 0.0), &StaticSettings::default()).unwrap();
    assert!(report.converged, "{report:?}");
    let tip = 3685;
    let u = body.positions()[tip] - body.tets().unwrap().mesh().nodes[tip];
    assert!((u.x - 0.077_260_5).abs() < 1e-7 && (u.z + 0.017_485_9).abs() < 1e-7, "{u}");
    assert!((body.elastic_energy() - 5.640_269_45e-2).abs() < 1e-8);
}

//! Compares bodies stepped one after another and side by side: `cargo bench -p scindo-physics --bench bodies`.
//! `-- --quick` makes short runs. All lines of a group are measured in turns, so that a busy moment of the
//! machine hits all of them, and end with the same bits.

#![allow(clippy::disallowed_methods, clippy::unwrap_used)] // a bench reads the clock

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, PcgSettings};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::team::{Lead, Team, blocks};

const SOFT: Material = Material {
    young_pa: 1e5,
    poisson: 0.33,
    density_kg_m3: 100.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};
const DOWN: Vector3<f64> = Vector3::new(0.0, -9.81, 0.0);

/// Some bodies on some threads.
struct Group {
    threads: usize,
    bodies: Vec<Body>,
    /// Steps them side by side; one after another without.
    lead: Option<Lead>,
    /// Seconds per step of all bodies.
    times: Vec<f64>,
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    for (name, cells) in [
        ("two bars of 12 800 tets", vec![[40, 8, 8]; 2]),
        ("bars of 12 800 and 1 600 tets", vec![[40, 8, 8], [20, 4, 4]]),
        ("three bars of 1 600 tets", vec![[20, 4, 4]; 3]),
    ] {
        let mut groups =
            [(1, false), (2, false), (2, true)].map(|(threads, lead)| group(&cells, threads, lead));
        for _ in 0..if quick { 3 } else { 1000 } {
            groups.iter_mut().for_each(Group::step);
        }
        println!("{name}:");
        let alone = groups[0].best_and_median();
        for group in &mut groups {
            let way = if group.lead.is_some() { "side by side" } else { "one after another" };
            let [best, median] = group.best_and_median();
            println!(
                "  {} thread(s), {way:<17} best {:7.1} µs, median {:7.1} µs; {:.2} of one thread (median {:.2})",
                group.threads,
                best * 1e6,
                median * 1e6,
                best / alone[0],
                median / alone[1]
            );
        }
        let positions = |group: &Group| -> Vec<Vec<_>> {
            group.bodies.iter().map(|body| body.positions().to_vec()).collect()
        };
        assert!(groups.iter().all(|group| positions(group) == positions(&groups[0])), "the same bits");
    }
}

/// Bars with so many cells, clamped at x = 0.
fn group(cells: &[[usize; 3]], threads: usize, lead: bool) -> Group {
    let mut bodies: Vec<Body> = cells.iter().map(|&cells| bar(cells)).collect();
    let sizes: Vec<usize> = bodies.iter().map(Body::n_elements).collect();
    let (leader, teams) = Team::sharing(threads, &sizes).unwrap();
    bodies.iter_mut().zip(teams).for_each(|(body, team)| body.set_team(team));
    Group { threads, bodies, lead: lead.then_some(leader), times: Vec::new() }
}

fn bar(cells: [usize; 3]) -> Body {
    let mesh =
        box_mesh(Vector3::zeros(), Vector3::new(1.0, 0.2, 0.2), cells, BoxPattern::Tet5 { parity: false });
    let clamp: Vec<u32> = (0..mesh.nodes.len() as u32).filter(|&n| mesh.nodes[n as usize].x == 0.0).collect();
    let solver = PcgSettings { iterations: 10, tolerance: 0.0 };
    let mut body = Body::new(mesh, SOFT, BodySettings { solver, ..BodySettings::default() }).unwrap();
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    body
}

impl Group {
    fn step(&mut self) {
        let start = Instant::now();
        let step = |body: &mut Body| {
            body.step(0.04, DOWN, &[]);
        };
        match &mut self.lead {
            Some(lead) => lead.side_by_side(blocks(&mut self.bodies, 1), |_, body| step(&mut body[0])),
            None => self.bodies.iter_mut().for_each(step),
        }
        self.times.push(start.elapsed().as_secs_f64());
    }

    fn best_and_median(&mut self) -> [f64; 2] {
        self.times.sort_by(f64::total_cmp);
        [self.times[0], self.times[self.times.len() / 2]]
    }
}

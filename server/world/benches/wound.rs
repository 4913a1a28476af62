//! What contact of a body with itself costs: `cargo bench -p scindo-world --bench wound`. `-- --quick` makes short runs.
//!
//! A wound with about 2,000 triangles on its lips, with and without self-contact: pressed shut by plates and tools;
//! held open in its middle, while its ends touch; pulled open by plates and tools, and by plates alone; and opened and
//! closed once per second. The steps are made in turns, so that a busy moment of the machine hits all of them.

#![allow(clippy::disallowed_methods, clippy::unwrap_used)] // a bench reads the clock

use std::path::Path;
use std::time::Instant;

use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::Inputs;
use scindo_world::report::Stage;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

/// Steps in which the tools reach their places, and steps that are measured.
const STEPS: [usize; 2] = [30, 200];

/// A wound, and what its steps cost.
struct Wound {
    sim: Simulation,
    /// Seconds per step, and those of its detection of contact.
    times: Vec<[f64; 2]>,
    iterations: u32,
    contacts: u32,
    /// Largest depth in cells.
    deepest: f64,
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    let steps = if quick { [5, 3] } else { STEPS };
    for (name, plates_m, by_m) in [
        ("pressed shut", 0.006, Some([0.006, 0.008])),
        ("touching at its ends", 0.0, Some([-0.02, -0.022])),
        ("pulled open", -0.006, Some([-0.02, -0.022])),
        ("pulled open, without tools", -0.02, None),
        ("opened and closed again and again", 0.0, Some([0.006, -0.02])),
    ] {
        let mut wounds = [false, true].map(|itself| Wound::new(itself, plates_m, by_m));
        for step in 0..steps[0] + steps[1] {
            wounds.iter_mut().for_each(|wound| wound.step(step >= steps[0]));
        }
        let tags = &wounds[0].sim.bodies()[0].body.surface().tags;
        let lips = tags.iter().filter(|tag| **tag > 0).count();
        println!(
            "{name}, {} elements, {lips} triangles on the lips:",
            wounds[0].sim.bodies()[0].body.n_elements()
        );
        let [off, on] = wounds.each_mut().map(Wound::tell);
        println!("  time {:.2} and iterations {:.2} times as without it", on[0] / off[0], on[1] / off[1]);
    }
}

/// A tool that holds a lip at `x` and moves it to and fro between two places.
fn holder(id: &str, x: f64, [from, to]: [f64; 2]) -> String {
    let at = |time: f64, by: f64| {
        format!("{{ at_s = {time:?}, tip_m = [{:?}, 0.075, 0.12], mode = \"grab\" }},", x + by)
    };
    let path = [at(0.0, 0.0), at(0.2, from), at(0.7, to), at(1.2, from), at(1.7, to), at(2.2, from)].concat();
    format!(
        "[[tool]]\nid = \"{id}\"\nshape = {{ sphere = {{ radius_m = 0.02 }} }}\nstiffness_n_m = 2000\n\
         max_force_n = 10000\npath = [{path}]\n"
    )
}

impl Wound {
    /// A block with an incision. Plates on two of its sides move inwards by `plates_m`, tools, if any, push its lips by
    /// `by_m` [m].
    fn new(itself: bool, plates_m: f64, by_m: Option<[f64; 2]>) -> Self {
        let plate = |from: f64, to: f64, by: f64| {
            format!(
                "[[body.fix]]\nwhere = {{ slab = {{ axis = \"x\", from = {from:?}, to = {to:?} }} }}\n\
                 displacement_m = [{by:?}, 0, 0]\n"
            )
        };
        let scene = [
            &*format!(
                "schema = 1\nworld = {{ gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }}\n\
                 effects = {{ self_collision = {itself} }}\n"
            ),
            "[[body]]\nid = \"flesh\"\nyoung_pa = 2e4\npoisson = 0.4\ndensity_kg_m3 = 1000\n\
             mesh = { box = { min_m = [0, 0, 0], max_m = [0.25, 0.15, 0.15], cells = [25, 15, 15] } }\n\
             rayleigh = { stiffness_s = 0.005 }\ndisplacement_over_s = 0.2\n",
            &plate(0.0, 0.01, plates_m),
            &plate(0.99, 1.0, -plates_m),
            "[[cut]]\nbody = \"flesh\"\nsweep_m = [ [[0.124, -0.01, 0.17], [0.124, -0.01, 0.033]], \
             [[0.124, 0.16, 0.17], [0.124, 0.16, 0.033]] ]\n",
            &by_m.map(|by| holder("left", 0.1, by)).unwrap_or_default(),
            &by_m.map(|by| holder("right", 0.148, by.map(|by| -by))).unwrap_or_default(),
        ]
        .concat();
        let scene = Scene::from_toml(&scene).unwrap();
        let options = BuildOptions { threads: 1, portable: false };
        let sim = Simulation::with_options(&scene, Path::new(""), options).unwrap();
        Self { sim, times: Vec::new(), iterations: 0, contacts: 0, deepest: 0.0 }
    }

    fn step(&mut self, measure: bool) {
        let start = Instant::now();
        self.sim.step(&Inputs::default());
        let seconds = start.elapsed().as_secs_f64();
        if !measure {
            return;
        }
        let report = self.sim.report();
        self.times.push([seconds, report.seconds.of(Stage::Contacts)]);
        self.iterations += report.bodies[0].solve.iterations;
        for touch in self.sim.touch_reports() {
            self.contacts = self.contacts.max(touch.contacts);
            self.deepest = self.deepest.max(touch.deepest_m / self.sim.bodies()[0].cell_m());
        }
    }

    /// Prints the figures; returns the median time of a step [s] and the mean iterations.
    fn tell(&mut self) -> [f64; 2] {
        let median = |i: usize| {
            let mut times: Vec<f64> = self.times.iter().map(|times| times[i]).collect();
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        };
        let (step, detection) = (median(0), median(1));
        let iterations = f64::from(self.iterations) / self.times.len() as f64;
        println!(
            "  {:<20} {:6.2} ms per step, {:.3} ms of it contacts; {iterations:.1} iterations; \
             at most {} contacts, {:.3} h deep",
            if self.sim.plan().is_on("self-collision") {
                "with self-contact"
            } else {
                "without self-contact"
            },
            1e3 * step,
            1e3 * detection,
            self.contacts,
            self.deepest
        );
        [step, iterations]
    }
}

//! Cases of contact: bodies on obstacles, on each other and on themselves. Each is a whole scene.

use nalgebra::Vector3;
use scindo_physics::body::Outcome;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::view;
use scindo_world::inputs::Inputs;
use scindo_world::simulation::Simulation;

use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;

/// Case 28.
pub(super) const LIPS: Case = Case {
    number: Some(28),
    name: "lips-in-contact",
    title: "The lips of a cut are opened and pressed together",
    set_up: "A block with an incision of three quarters of its depth. Two tools hold its lips, open them by 2 cm, \
             press them 8 mm into each other and open them again, 12 times with 40 steps each. The long form makes \
             1000 cycles.",
    rule: "Every step advances and is whole. No vertex is deeper than 0.05 h in the other lip. The energy at the \
           same phase of a cycle stays within a thousandth of that of the first three. After the last cycle the lips \
           lie within 0.05 h of each other. Without self-contact they pass through each other.",
    source: "Teschner 2003; Chen, Diaz, Yuksel 2023: what self-contact of cut bodies has to bear",
    quick: true,
    run: lips,
};

/// A block on a slope.
pub(super) const INCLINE: Case = Case {
    number: None,
    name: "incline",
    title: "A block on a slope, 5 % below and above the critical angle",
    set_up: "A soft block on a plane with friction 0.5, whose slope is 0.95 and 1.05 times the friction; 2000 steps \
             of 10 ms. The long form makes 10⁴ steps. Below the critical angle it also falls on the slope.",
    rule: "Below the critical angle it creeps by less than 1e-6 m after it has settled, and the impact stops it within \
           1 cm, a quarter of the way that it would slide without friction in the impact. Above, it slides with g (sin θ − μ cos θ) to 2 %.",
    source: "Larionov et al. 2022: lagged friction fails next to the critical angle",
    quick: true,
    run: incline,
};

/// A body dropped on a needle, and a large one on the floor.
pub(super) const NEEDLE: Case = Case {
    number: None,
    name: "needle",
    title: "A body falls on a needle",
    set_up: "A block of 6 cm falls from 30 cm on an upright capsule of 2 mm radius, which is thinner than an element \
             is wide, and on the floor around it. Its skin is as fine as the capsule: obstacles are felt by the \
             vertices of the surface. Steps of 10 ms.",
    rule: "Every step advances, all numbers stay finite, no element is inverted at the end. The needle takes more than \
           the weight of the block when it is hit, and at the end the obstacles carry it.",
    source: "own",
    quick: true,
    run: needle,
};

/// The thesis' own scene of a body on the floor.
pub(super) const HIPPO: Case = Case {
    number: None,
    name: "falls-on-floor",
    title: "A large linear body falls on the floor with ten iterations per step",
    set_up: "20,800 tetrahedra, E = 0.1 MPa, ν = 0.33, density 1000 kg/m³, linear law, as the Hippo of the thesis; 125 \
             steps of 40 ms with exactly ten iterations of conjugate gradients.",
    rule: "Every step advances; no vertex is more than 0.05 m below the floor; everything stays finite. (The thesis \
           prints 7 s for these 5 s, on one core of 2007.)",
    source: "Jeřábková 2007, §5.1",
    quick: true,
    run: hippo,
};

/// Two bodies wedged between walls, and one that is pressed through a gap.
pub(super) const WEDGED: Case = Case {
    number: None,
    name: "wedged",
    title: "Bodies are wedged and pressed into a gap",
    set_up: "Two blocks lie side by side in a trough that is 5 % narrower than both of them together. A third one is \
             pushed by its load into a gap of 5 mm between two posts, through which it does not fit.",
    rule: "Every step advances and is whole; the kinetic energy at the end is below 1e-6 J; nothing is deeper than \
           0.2 h in anything.",
    source: "own",
    quick: true,
    run: wedged,
};

/// A cut that is made while its lips are pressed together.
pub(super) const PRESSED: Case = Case {
    number: None,
    name: "cut-while-pressed",
    title: "A block is cut while it is pressed together",
    set_up: "A block between two walls that press it together by 10 % is cut through between them; and another one \
             halfway, and then again along the same plane and through. The tissue has moved in between, so slivers \
             of a five-hundredth of an element come to lie between its lips.",
    rule: "Every step advances; both halves stay on their sides and come to rest. The lips of the one cut are never \
           deeper than 0.05 h in each other; slivers, which are far thinner than that, less than 1 h.",
    source: "own",
    quick: false,
    run: pressed,
};

pub(super) const WORLD: &str = "schema = 1\nworld = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }\n";
const FLOOR: &str =
    "[[obstacle]]\nid = \"floor\"\nhalf_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }\n";

/// A box-shaped body.
pub(super) fn block(id: &str, min: [f64; 3], max: [f64; 3], cells: [usize; 3], lines: &str) -> String {
    format!(
        "[[body]]\nid = \"{id}\"\nmesh = {{ box = {{ min_m = {min:?}, max_m = {max:?}, cells = {cells:?} }} }}\n\
         young_pa = 2e4\npoisson = 0.4\ndensity_kg_m3 = 1000\nrayleigh = {{ stiffness_s = 0.005 }}\n{lines}\n"
    )
}

/// A scene that is stepped, with what every case of contact must keep.
pub(super) struct Run {
    pub(super) sim: Simulation,
    not_whole: usize,
    not_finite: usize,
    /// Largest depth in another body, in the body itself, or in an obstacle, in cells.
    deepest: f64,
    kinetic: Vec<[f64; 2]>,
    depth: Vec<[f64; 2]>,
}

impl Run {
    pub(super) fn new(text: &str, setting: &Setting) -> Result<Self, Trouble> {
        let sim = setting.scene(text, 1)?;
        Ok(Self { sim, not_whole: 0, not_finite: 0, deepest: 0.0, kinetic: Vec::new(), depth: Vec::new() })
    }

    fn step(&mut self) {
        self.sim.step(&Inputs::default());
        let cell = self.sim.bodies().iter().map(|body| body.cell_m()).fold(f64::INFINITY, f64::min);
        let touch = self.sim.touch_reports().iter().map(|report| report.deepest_m);
        let rest = (0..self.sim.bodies().len()).map(|body| self.sim.rest_report(body).deepest_m);
        let deepest = touch.chain(rest).fold(0.0, f64::max) / cell;
        self.deepest = self.deepest.max(deepest);
        for (body, report) in self.sim.bodies().iter().zip(&self.sim.report().bodies) {
            let whole = report.solve.outcome == Outcome::Advanced && !report.solve.is_divided();
            self.not_whole += usize::from(!whole);
            let finite = body.body.positions().iter().flatten().all(|x| x.is_finite());
            self.not_finite += usize::from(!finite);
        }
        let time = self.sim.time_s();
        self.kinetic.push([time, self.kinetic_energy()]);
        self.depth.push([time, deepest]);
    }

    pub(super) fn steps(&mut self, n: usize) {
        (0..n).for_each(|_| self.step());
    }

    pub(super) fn kinetic_energy(&self) -> f64 {
        self.sim.bodies().iter().map(|body| body.body.kinetic_energy()).sum()
    }

    fn energy(&self) -> f64 {
        self.sim.bodies().iter().map(|body| body.energy()).map(|e| e.kinetic_j + e.elastic_j).sum()
    }

    /// Adds what every case tells.
    pub(super) fn tell(self, name: &str, depth: f64, evidence: &mut Evidence) {
        let of = |what: &str| if name.is_empty() { what.to_owned() } else { format!("{what}, {name}") };
        evidence.exactly(of("steps held, refused or divided"), self.not_whole, 0);
        evidence.exactly(of("bodies with numbers that are not finite"), self.not_finite, 0);
        evidence.at_most(of("largest depth in anything"), self.deepest, depth, "h");
        let line = |points| vec![Line { name: name.into(), points }];
        evidence.charts.push(Chart {
            title: of("Kinetic energy"),
            x_label: "time [s]".into(),
            y_label: "energy [J]".into(),
            logarithmic: false,
            lines: line(self.kinetic),
        });
        evidence.charts.push(Chart {
            title: of("Largest depth"),
            x_label: "time [s]".into(),
            y_label: "depth [h]".into(),
            logarithmic: false,
            lines: line(self.depth),
        });
        for body in self.sim.bodies() {
            evidence.pictures.push(view::body(&body.body, of(&format!("{} at the end", body.id))));
        }
    }
}

/// A tool that holds a lip at `x` and moves it to and fro.
fn holder(id: &str, x: f64, open: f64, shut: f64) -> String {
    let at = |time: f64, by: f64| {
        format!("{{ at_s = {time:?}, tip_m = [{:?}, 0.03, 0.04], mode = \"grab\" }},", x + by)
    };
    let path = [at(0.0, 0.0), at(0.1, open), at(0.2, 0.0), at(0.3, shut), at(0.4, 0.0)].concat();
    format!(
        "[[tool]]\nid = \"{id}\"\nshape = {{ sphere = {{ radius_m = 0.004 }} }}\nstiffness_n_m = 400\n\
         repeat_s = 0.4\npath = [{path}]\n"
    )
}

fn wound(itself: bool) -> String {
    let fixed = "[[body.fix]]\nwhere = { slab = { axis = \"z\", from = 0, to = 0.01 } }";
    [
        WORLD,
        &format!("effects = {{ self_collision = {itself} }}\n"),
        &block("flesh", [0.0; 3], [0.1, 0.06, 0.04], [10, 6, 4], fixed),
        "[[cut]]\nbody = \"flesh\"\nsweep_m = [ [[0.051, -0.01, 0.05], [0.051, -0.01, 0.013]], \
         [[0.051, 0.07, 0.05], [0.051, 0.07, 0.013]] ]\n",
        &holder("left", 0.042, -0.01, 0.004),
        &holder("right", 0.06, 0.01, -0.004),
    ]
    .concat()
}

fn lips(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let cycles = if setting.long { 1000 } else { 12 };
    let mut run = Run::new(&wound(true), setting)?;
    // Energies at the open end of every cycle.
    let mut open = Vec::with_capacity(cycles);
    for _ in 0..cycles {
        run.steps(10);
        open.push(run.energy());
        run.steps(30);
    }
    let most = |energies: &[f64]| energies.iter().copied().fold(0.0, f64::max);
    let growth = most(&open[3..]) / most(&open[..3]) - 1.0;
    evidence.at_most("growth of the energy of the open wound", growth, 1e-3, "");
    evidence.tell("cycles", cycles as f64, "");
    let defects = run.sim.bodies()[0].body.surface().n_defects();
    evidence.exactly("defects of the surface", defects, 0);
    run.tell("", 0.05, &mut evidence);
    // The same without contact.
    let mut free = Run::new(&wound(false), setting)?;
    free.steps(30);
    evidence.at_least("overlap of the lips without self-contact", overlap(&free.sim), 0.3, "h");
    Ok(evidence)
}

/// By how much the left lip reaches beyond the right one near the tools, in cells.
fn overlap(sim: &Simulation) -> f64 {
    let body = &sim.bodies()[0];
    let (x, rest) = (body.body.positions(), body.body.rest_positions());
    let surface = body.body.surface();
    let (mut left, mut right) = (f64::NEG_INFINITY, f64::INFINITY);
    for (triangle, _) in surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag > 0) {
        let corners = |x: &[Vector3<f64>]| triangle.map(|v| surface.vertices[v as usize].position(x));
        let [a, b, c] = corners(rest);
        let middle = (a + b + c) / 3.0;
        if middle.z < 0.03 || (middle.y - 0.03).abs() > 0.015 {
            continue;
        }
        let now = corners(x).iter().map(|p| p.x).sum::<f64>() / 3.0;
        // The left lip faces right.
        if (b - a).cross(&(c - a)).x > 0.0 { left = left.max(now) } else { right = right.min(now) }
    }
    (left - right) / body.cell_m()
}

fn incline(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let steps = if setting.long { 10_000 } else { 2000 };
    for share in [0.95, 1.05] {
        let angle = (share * 0.5_f64).atan();
        let (x, z) = (9.81 * angle.sin(), -9.81 * angle.cos());
        let world = WORLD.replace("[0, 0, -9.81]", &format!("[{x}, 0, {z}]"));
        let floor = FLOOR.replace("[0, 0, 1] }", "[0, 0, 1] }\nfriction = 0.5");
        let body = block("block", [0.0; 3], [0.1, 0.1, 0.06], [5, 5, 3], "");
        let mut run = Run::new(&[&*world, &body, &floor].concat(), setting)?;
        run.steps(400);
        let before = run.sim.bodies()[0].body.centre_of_mass();
        let speed = run.sim.bodies()[0].body.momentum().x;
        // Sliding for long would leave single precision behind.
        let n = if share < 1.0 { steps - 400 } else { 400 };
        run.steps(n);
        let body = &run.sim.bodies()[0].body;
        let name = format!("{share} of the critical slope");
        if share < 1.0 {
            let crept = (body.centre_of_mass() - before).norm();
            evidence.at_most(format!("creep, {name}"), crept, 1e-6, "m");
        } else {
            let found = (body.momentum().x - speed) / body.total_mass() / (0.01 * n as f64);
            let expected = 9.81 * (angle.sin() - 0.5 * angle.cos());
            evidence.at_most(
                format!("error of its acceleration, {name}"),
                (found / expected - 1.0).abs(),
                0.02,
                "",
            );
        }
        run.tell(&name, 0.05, &mut evidence);
        if share < 1.0 {
            let body = block("block", [0.0, 0.0, DROP_M], [0.1, 0.1, 0.06 + DROP_M], [5, 5, 3], "");
            let mut run = Run::new(&[&*world, &body, &floor].concat(), setting)?;
            while run.sim.rest_report(0).contacts == 0 && run.sim.steps() < 100 {
                run.step();
            }
            let met = run.sim.bodies()[0].body.centre_of_mass();
            run.steps(200);
            let slid = run.sim.bodies()[0].body.centre_of_mass().x - met.x;
            evidence.at_most(format!("slide after a fall of {} mm, {name}", 1e3 * DROP_M), slid, 1e-2, "m");
            run.tell(&format!("after a fall, {name}"), 0.2, &mut evidence);
        }
    }
    Ok(evidence)
}

/// Height from which the block falls on the slope [m].
const DROP_M: f64 = 5e-3;

fn needle(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let skin = "skin = { divisions = 8 }";
    let body = block("block", [-0.03, -0.03, 0.33], [0.03, 0.03, 0.39], [4, 4, 4], skin);
    let needle =
        "[[obstacle]]\nid = \"needle\"\ncapsule = { ends_m = [[0, 0, 0], [0, 0, 0.02]], radius_m = 0.002 }\n";
    let mut run = Run::new(&[WORLD, &body, FLOOR, needle].concat(), setting)?;
    let weight = 9.81 * run.sim.bodies()[0].body.total_mass();
    let mut hit = 0.0f64;
    for _ in 0..300 {
        run.step();
        hit = hit.max(run.sim.rest_reports(0).get(1).map_or(0.0, |report| report.normal_n));
    }
    evidence.at_least("largest force of the needle, over the weight", hit / weight, 1.0, "");
    let report = *run.sim.rest_report(0);
    evidence.at_most("error of the force that carries it", (report.force_n.z / weight - 1.0).abs(), 0.05, "");
    evidence.exactly("inverted elements at the end", run.sim.report().bodies[0].solve.inverted_pieces, 0);
    run.tell("", 1.0, &mut evidence);
    Ok(evidence)
}

fn hippo(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let world = WORLD.replace("step_s = 0.01", "step_s = 0.04");
    let body = "[[body]]\nid = \"hippo\"\nlaw = \"linear\"\nyoung_pa = 1e5\npoisson = 0.33\ndensity_kg_m3 = 1000\n\
                mesh = { box = { min_m = [0, 0, 0.5], max_m = [2.0, 1.0, 1.3], cells = [26, 16, 10], pattern = \"tet5\" } }\n\
                solver = { iterations = 10 }\n";
    let mut run = Run::new(&[&*world, body, FLOOR].concat(), setting)?;
    let mut lowest = f64::INFINITY;
    for _ in 0..125 {
        run.step();
        let z = run.sim.bodies()[0].body.positions().iter().map(|x| x.z);
        lowest = z.fold(lowest, f64::min);
    }
    evidence.tell("tetrahedra", run.sim.bodies()[0].body.n_elements() as f64, "");
    evidence.at_least("lowest vertex in all steps", lowest, -0.05, "m");
    run.tell("", 1.0, &mut evidence);
    Ok(evidence)
}

fn wedged(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let effects = "effects = { body_collision = true }\n";
    let wall = |id: &str, x: f64, towards: i32| {
        format!(
            "[[obstacle]]\nid = \"{id}\"\nhalf_space = {{ point_m = [{x}, 0, 0], normal = [{towards}, 0, 0] }}\n"
        )
    };
    let blocks = [
        block("left", [0.0, 0.0, 0.0], [0.06, 0.06, 0.06], [3, 3, 3], ""),
        block("right", [0.06, 0.005, 0.0], [0.12, 0.065, 0.06], [3, 3, 3], ""),
    ]
    .concat();
    let trough = [wall("west", 0.003, 1), wall("east", 0.117, -1)].concat();
    let mut run = Run::new(&[WORLD, effects, &blocks, FLOOR, &trough].concat(), setting)?;
    run.steps(400);
    evidence.at_most("kinetic energy at the end, trough", run.kinetic_energy(), 1e-6, "J");
    run.tell("trough", 0.2, &mut evidence);

    let posts = "[[obstacle]]\nid = \"left\"\ncapsule = { ends_m = [[-0.0125, -1, -0.01], [-0.0125, 1, -0.01]], radius_m = 0.01 }\n\
                 [[obstacle]]\nid = \"right\"\ncapsule = { ends_m = [[0.0125, -1, -0.01], [0.0125, 1, -0.01]], radius_m = 0.01 }\n";
    let load = "[[body.load]]\nwhere = { slab = { axis = \"z\", from = 0, to = 1 } }\nforce_n = [0, 0, -3]";
    let body = block("pushed", [-0.03, -0.03, 0.001], [0.03, 0.03, 0.061], [8, 8, 8], load);
    let mut run = Run::new(&[WORLD, &body, posts].concat(), setting)?;
    run.steps(400);
    evidence.at_most("kinetic energy at the end, gap", run.kinetic_energy(), 1e-6, "J");
    let centre = run.sim.bodies()[0].body.centre_of_mass();
    evidence.at_least("height of its centre above the gap", centre.z, 0.0, "m");
    run.tell("gap", 0.2, &mut evidence);
    Ok(evidence)
}

fn pressed(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let wall = |id: &str, x: f64, towards: i32| {
        format!(
            "[[obstacle]]\nid = \"{id}\"\nhalf_space = {{ point_m = [{x}, 0, 0], normal = [{towards}, 0, 0] }}\n"
        )
    };
    let cut = |at: f64, from: f64, to: f64| {
        format!(
            "[[cut]]\nbody = \"block\"\nat_s = {at}\nsweep_m = [ [[0.041, {from}, -0.02], [0.041, {from}, 0.1]], \
             [[0.041, {to}, -0.02], [0.041, {to}, 0.1]] ]\n"
        )
    };
    let block = [
        WORLD,
        "effects = { self_collision = true }\n",
        &block("block", [0.0; 3], [0.08, 0.06, 0.06], [8, 6, 6], ""),
        FLOOR,
        &wall("west", 0.004, 1),
        &wall("east", 0.076, -1),
    ]
    .concat();
    let once = cut(0.5, -0.02, 0.08);
    let twice = cut(0.5, -0.02, 0.02) + &cut(1.0, -0.02, 0.08);
    for (name, cuts, depth) in [("one cut", once, 0.05), ("cut again", twice, 1.0)] {
        let mut run = Run::new(&[&*block, &cuts].concat(), setting)?;
        run.steps(300);
        let body = &run.sim.bodies()[0].body;
        evidence.at_least(format!("parts at the end, {name}"), body.parts().len() as f64, 2.0, "");
        let mut centres: Vec<Vector3<f64>> = Vec::new();
        body.part_centres(&mut centres);
        let apart = centres.iter().map(|c| c.x).fold(f64::NEG_INFINITY, f64::max)
            - centres.iter().map(|c| c.x).fold(f64::INFINITY, f64::min);
        evidence.at_least(format!("distance of the centres of both halves, {name}"), apart, 0.033, "m");
        evidence.at_most(format!("kinetic energy at the end, {name}"), run.kinetic_energy(), 1e-6, "J");
        run.tell(name, depth, &mut evidence);
    }
    Ok(evidence)
}

//! Scenes that nobody would write: every setting drawn at random, the same for the same seed.
//!
//! Most of them are legal. Some are refused by the checks, many are too soft, too stiff, too coarse in time or
//! held by too little for what they ask: the point is what the program says then.

use std::fmt::Write as _;

use fastrand::Rng;

/// A scene and how many steps of it to run.
#[derive(Debug, Clone)]
pub struct RandomScene {
    /// What it was drawn with.
    pub seed: u64,
    /// The scene file.
    pub toml: String,
    /// Steps to run.
    pub steps: u32,
    /// No node can sensibly go further than this [m]: many times the size of a body, the free fall, and the
    /// flight of what a load pushes.
    pub reach_m: f64,
}

/// What later parts of a scene have to know of a body.
struct Body {
    id: String,
    /// Corners of its box [m].
    low: [f64; 3],
    high: [f64; 3],
    element: &'static str,
    young_pa: f64,
    /// What its loads accelerate it by where nothing holds it [m/s²].
    pushed_m_s2: f64,
}

impl Body {
    fn extent(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.high[k] - self.low[k])
    }

    fn diagonal(&self) -> f64 {
        self.extent().iter().map(|e| e * e).sum::<f64>().sqrt()
    }

    /// A point of the box, or within `beyond` of its extent around it [m].
    fn point(&self, rng: &mut Rng, beyond: f64) -> [f64; 3] {
        let extent = self.extent();
        [0, 1, 2].map(|k| self.low[k] + extent[k] * uniform(rng, -beyond, 1.0 + beyond))
    }
}

/// The scene of a seed.
#[must_use]
pub fn random_scene(seed: u64) -> RandomScene {
    let mut rng = Rng::with_seed(seed);
    let rng = &mut rng;
    let step_s = logarithmic(rng, 2e-4, 0.1);
    let steps = rng.u32(3..=12);
    let gravity =
        pick(rng, &["[0.0, 0.0, -9.81]", "[0.0, -9.81, 0.0]", "[0.0, 0.0, 0.0]", "[30.0, 5.0, -9.81]"]);
    let mut toml = format!("schema = 1\nname = \"random-{seed}\"\n[world]\ngravity_m_s2 = {gravity}\n");
    let _ = writeln!(toml, "step_s = {step_s:e}");
    let mut bodies = Vec::new();
    for index in 0..if rng.u32(0..5) == 0 { 2 } else { 1 } {
        bodies.push(body(rng, index, &mut toml));
    }
    for body in &bodies {
        if body.element == "tet4" || rng.u32(0..20) == 0 {
            for _ in 0..pick(rng, &[0, 0, 1, 1, 2, 4]) {
                cut(rng, body, step_s * f64::from(steps), &mut toml);
            }
        }
    }
    for index in 0..pick(rng, &[0, 0, 1, 1, 2]) {
        let body = &bodies[rng.usize(0..bodies.len())];
        tool(rng, index, body, step_s * f64::from(steps), &mut toml);
    }
    let _ = writeln!(toml, "[effects]\nenergy = {}", rng.bool());
    if bodies.iter().all(|body| body.element == "tet4") && rng.bool() {
        toml.push_str("error_estimate = true\n");
    }
    let time_s = step_s * f64::from(steps);
    let largest = bodies.iter().map(Body::diagonal).fold(0.0, f64::max);
    let pushed = bodies.iter().map(|body| body.pushed_m_s2).fold(0.0, f64::max);
    RandomScene { seed, toml, steps, reach_m: 20.0 * largest + (40.0 + 4.0 * pushed) * time_s * time_s }
}

fn body(rng: &mut Rng, index: u32, toml: &mut String) -> Body {
    let element = pick(rng, &["tet4", "tet4", "tet4", "tet10", "hex8"]);
    let size = logarithmic(rng, 2e-3, 2.0);
    let slender = pick(rng, &[1.0, 1.0, 0.3, 0.05, 1e-3]);
    let thin = rng.usize(0..3);
    let mut extent = [0, 1, 2].map(|_| size * uniform(rng, 0.3, 1.0));
    extent[thin] *= slender;
    let low = [f64::from(index) * 5.0, 0.0, 0.0];
    let organ = element != "hex8" && rng.u32(0..8) == 0;
    let (low, high) = match organ {
        // The demonstration's body lies around the origin.
        true => ([-0.08, -0.05, 0.0], [0.08, 0.05, 0.06]),
        false => (low, [0, 1, 2].map(|k| low[k] + extent[k])),
    };
    let cells = [0, 1, 2].map(|_| rng.u32(1..=5));
    let pattern = if element == "hex8" { "hex" } else { pick(rng, &["tet5", "tet6", "oct6"]) };
    let id = format!("b{index}");
    let _ = writeln!(toml, "[[body]]\nid = \"{id}\"");
    let _ = match organ {
        true => writeln!(toml, "mesh = {{ organ = {{ cells = {} }} }}", rng.u32(4..=8)),
        false => writeln!(
            toml,
            "mesh = {{ box = {{ min_m = {low:?}, max_m = {high:?}, cells = {cells:?}, pattern = \"{pattern}\" }} }}"
        ),
    };
    let young_pa = logarithmic(rng, 10.0, 1e9);
    let _ = writeln!(toml, "element = \"{element}\"\nyoung_pa = {young_pa:e}");
    let _ = writeln!(toml, "poisson = {:?}", pick(rng, &[0.0, 0.2, 0.3, 0.45, 0.49, 0.499]));
    let density_kg_m3 = logarithmic(rng, 1.0, 1e4);
    let _ = writeln!(toml, "density_kg_m3 = {density_kg_m3:e}");
    let mut body = Body { id, low, high, element, young_pa, pushed_m_s2: 0.0 };
    mechanics(rng, &body, toml);
    let mut tables = String::new();
    let force_n = holds(rng, &body, &mut tables);
    body.pushed_m_s2 = force_n / (density_kg_m3 * body.extent().iter().product::<f64>());
    toml.push_str(&tables);
    body
}

/// Law, integrator, solver and the like; now and then settings that do not go together.
fn mechanics(rng: &mut Rng, body: &Body, toml: &mut String) {
    let law = pick(rng, &["linear", "corotational", "corotational", "stvk", "neo-hookean"]);
    let integrators = ["implicit-euler", "implicit-euler", "bdf2", "newmark", "generalised-alpha", "static"];
    let explicit = rng.u32(0..6) == 0;
    let integrator = match explicit {
        true => pick(rng, &["symplectic-euler", "midpoint", "rk4"]),
        false => pick(rng, &integrators),
    };
    let _ = writeln!(toml, "law = \"{law}\"\nintegrator = \"{integrator}\"");
    let _ = writeln!(toml, "mass = \"{}\"", pick(rng, &["lumped", "lumped", "lumped", "consistent"]));
    let careless = rng.u32(0..30) == 0;
    let locking = match (body.element, law) {
        ("tet4", "linear" | "corotational" | "neo-hookean") => "node-averaged",
        ("hex8", "linear" | "corotational" | "neo-hookean") => "selective",
        _ if careless => "node-averaged",
        _ => "none",
    };
    if rng.u32(0..3) == 0 {
        let _ = writeln!(toml, "locking = \"{locking}\"");
    }
    if rng.u32(0..3) == 0 {
        let (alpha, beta) = (uniform(rng, 0.0, 5.0), logarithmic(rng, 1e-6, 1e-2));
        let _ = writeln!(toml, "rayleigh = {{ mass_1_s = {alpha:?}, stiffness_s = {beta:e} }}");
    }
    if explicit && !careless {
        return;
    }
    let mut keys = vec![format!("method = \"{}\"", pick(rng, &["pcg", "pcg", "pcg", "cg", "cholesky"]))];
    if rng.u32(0..3) > 0 {
        keys.push(format!("iterations = {}", rng.u32(1..=400)));
    }
    if rng.u32(0..3) > 0 {
        keys.push(format!("tolerance = {:e}", logarithmic(rng, 1e-12, 0.5)));
    }
    if rng.u32(0..4) == 0 {
        keys.push(format!("precision = \"{}\"", pick(rng, &["mixed", "double"])));
    }
    if rng.u32(0..4) == 0 {
        keys.push(format!("newton_steps = {}", rng.u32(1..=20)));
    }
    let _ = writeln!(toml, "solver = {{ {} }}", keys.join(", "));
}

/// Supports and loads; the largest force [N] that these loads sum up to.
fn holds(rng: &mut Rng, body: &Body, toml: &mut String) -> f64 {
    let axis = |rng: &mut Rng| pick(rng, &["x", "y", "z"]);
    for _ in 0..pick(rng, &[0, 1, 1, 1, 1, 2]) {
        let region = match rng.u32(0..4) {
            0 => {
                let point = body.point(rng, 0.0);
                let normal = [0, 1, 2].map(|_| uniform(rng, -1.0, 1.0));
                format!("half_space = {{ point_m = {point:?}, normal = {normal:?} }}")
            }
            1 => format!("slab = {{ axis = \"{}\", from = 1, to = 1 }}", axis(rng)),
            _ => format!("slab = {{ axis = \"{}\", from = 0, to = 0 }}", axis(rng)),
        };
        let axes = pick(rng, &["xyz", "xyz", "xyz", "xyz", "xy", "z", "x", "yz"]);
        let _ = writeln!(toml, "[[body.fix]]\nwhere = {{ {region} }}\naxes = \"{axes}\"");
        if rng.u32(0..5) == 0 {
            let d = 0.3 * body.diagonal();
            let _ = writeln!(toml, "displacement_m = {:?}", [0, 1, 2].map(|_| uniform(rng, -d, d)));
        }
    }
    if rng.u32(0..4) == 0 {
        // Up to what would shear the body by once its size.
        let most = body.young_pa * body.diagonal().powi(2) * logarithmic(rng, 1e-5, 1.0);
        let force = [0, 1, 2].map(|_| uniform(rng, -most, most));
        let _ = writeln!(
            toml,
            "[[body.load]]\nwhere = {{ slab = {{ axis = \"{}\", from = 1, to = 1 }} }}",
            axis(rng)
        );
        let _ = writeln!(toml, "force_n = {force:?}");
        return force.iter().map(|f| f * f).sum::<f64>().sqrt();
    }
    0.0
}

/// A cut by a plane through the body, or by a blade that goes anywhere.
fn cut(rng: &mut Rng, body: &Body, end_s: f64, toml: &mut String) {
    let at_s = if rng.bool() { 0.0 } else { uniform(rng, 0.0, end_s) };
    let segments: Vec<[[f64; 3]; 2]> = if rng.u32(0..3) > 0 {
        let (axis, across) = (rng.usize(0..3), rng.u32(0..2) as usize);
        let (u, v) = ((axis + 1 + across) % 3, (axis + 2 - across) % 3);
        let (extent, place, depth) =
            (body.extent(), pick(rng, &[0.5, 0.25, 0.3712, 0.9]), pick(rng, &[0.5, 0.7, 1.1, 1.1]));
        let at = |along: f64, to: f64| {
            let mut point = body.low;
            point[axis] += place * extent[axis];
            point[u] += along * extent[u];
            point[v] += to * extent[v];
            point
        };
        vec![[at(-0.1, -0.1), at(1.1, -0.1)], [at(-0.1, depth), at(1.1, depth)]]
    } else {
        (0..rng.usize(2..=6)).map(|_| [body.point(rng, 0.3), body.point(rng, 0.3)]).collect()
    };
    let _ = writeln!(toml, "[[cut]]\nbody = \"{}\"\nat_s = {at_s:e}\nsweep_m = {segments:?}", body.id);
}

/// A tool on a random way through the body.
fn tool(rng: &mut Rng, index: u32, body: &Body, end_s: f64, toml: &mut String) {
    let size = body.diagonal() * uniform(rng, 0.02, 0.2);
    let blade = rng.u32(0..4) == 0;
    let rod = format!("radius_m = {:e}, length_m = {:e}", 0.3 * size, 4.0 * size);
    let shape = match (blade, rng.u32(0..5)) {
        (true, _) => format!("blade = {{ length_m = {:e}, thickness_m = {:e} }}", 4.0 * size, 0.02 * size),
        (false, 0) => format!("sphere = {{ radius_m = {size:e} }}"),
        (false, 1) => format!("capsule = {{ radius_m = {size:e}, length_m = {:e} }}", 4.0 * size),
        (false, 2) => {
            let grip_n = logarithmic(rng, 1e-3, 1.0) * body.young_pa * size * size;
            let grip = format!("grip_force_n = {:e}, friction = {:e}", grip_n.clamp(1e-6, 1e4), rng.f64());
            format!("forceps = {{ {rod}, opening_m = {size:e}, {grip} }}")
        }
        (false, 3) => format!("retractor = {{ {rod}, width_m = {:e}, height_m = {size:e} }}", 2.0 * size),
        (false, _) => format!("hook = {{ {rod}, reach_m = {size:e}, point_m = {size:e} }}"),
    };
    let _ = writeln!(toml, "[[tool]]\nid = \"t{index}\"\nshape = {{ {shape} }}");
    let stiffness = logarithmic(rng, 0.01, 10.0) * body.young_pa * body.diagonal();
    let _ = writeln!(toml, "stiffness_n_m = {:e}", stiffness.clamp(1e-3, 1e5));
    let n = rng.u32(2..=4);
    let points = (0..n).map(|k| {
        let modes: &[&str] = if blade { &["cut", "hover"] } else { &["touch", "touch", "grab", "hover"] };
        let (at_s, tip, mode) = (end_s * f64::from(k) / f64::from(n), body.point(rng, 0.5), pick(rng, modes));
        let toward = [0, 1, 2].map(|_| uniform(rng, -1.0, 1.0));
        format!("{{ at_s = {at_s:e}, tip_m = {tip:?}, toward = {toward:?}, mode = \"{mode}\" }}")
    });
    let points: Vec<String> = points.collect();
    let _ = writeln!(toml, "path = [{}]", points.join(", "));
}

fn uniform(rng: &mut Rng, from: f64, to: f64) -> f64 {
    from + (to - from) * rng.f64()
}

/// Evenly in the order of magnitude.
fn logarithmic(rng: &mut Rng, from: f64, to: f64) -> f64 {
    uniform(rng, from.ln(), to.ln()).exp()
}

fn pick<T: Copy>(rng: &mut Rng, choices: &[T]) -> T {
    choices[rng.usize(0..choices.len())]
}

//! Schoch's beam, half cut in three ways: inside the elements, along their faces, and by a mesh made with the
//! cut. Each is loaded by gravity, by a dead force and by a prescribed strip.

use scindo_study::case::Case;
use scindo_study::design::Block;
use scindo_study::design::axes::{Axis, Factor, Setting, on_bodies, tolerances, words};
use scindo_study::trial::Protocol;
use scindo_study::trial::distance::Goal;

use super::gold::Gold;
use super::shared::{load, names};

/// Names of the ways to cut, labels of [`Factor::Cutting`].
pub const METHODS: [&str; 3] = ["xfem", "snap", "precut"];

/// The same methods on meshes where the plane of the cut lies inside elements but its front does not. They
/// show how much of an error the front causes.
pub const FRONTS: [&str; 2] = ["xfem-front", "snap-front"];

/// How the beam is loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pull {
    /// Gravity across the beam.
    Gravity,
    /// 5 N along the beam, on a strip of its free end.
    Force,
    /// The same strip, displaced by 20 mm along the beam.
    Strip,
}

/// What of a cut lies inside elements, a third of a cell beside their faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inside {
    /// Whether its plane does.
    pub plane: bool,
    /// Whether its front does.
    pub front: bool,
}

impl Inside {
    /// The mesh was made with the cut.
    pub const NOTHING: Self = Self { plane: false, front: false };
}

/// Cells of 6×12×40 in the beam, of 3×6×20 for a quick study. The strip ends on a line of cells.
const FINE: (&[f64], usize, usize) = (&[0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03], 12, 20);
const COARSE: (&[f64], usize, usize) = (&[0.0, 0.005, 0.015, 0.03], 6, 10);

/// Builds the case.
pub fn case(pull: Pull, quick: bool) -> Case {
    let body = ["beam".to_owned()];
    let gold = gold(pull);
    let (name, title, how, goal) = match pull {
        Pull::Gravity => ("cut-tc1", "gravity", "Gravity bends it sideways", [1.0, 0.0, 0.0]),
        Pull::Force => {
            ("cut-tc2force", "force", "A dead force of 5 N on a strip of its end pulls it", [0.0, 0.0, 1.0])
        }
        Pull::Strip => {
            ("cut-tc2strip", "displacement", "A strip of its end is moved by 20 mm along it", [1.0, 0.0, 0.0])
        }
    };
    let (x_m, y, half_z) = if quick { COARSE } else { FINE };
    let mut overrides = vec![gold.probes("beam"), format!("name=\"{name}\"")];
    overrides.extend(pulled(pull));
    let axes = vec![
        words(Factor::Law, &body, "law", &["linear", "corotational", "stvk"], "stvk"),
        methods(&body, x_m, y, half_z),
        tolerances(&body, &[1e-2, 1e-4, 1e-6, 1e-8], 1e-6),
    ];
    let cells = x_m.len() - 1;
    Case {
        name: name.into(),
        title: format!("Cutting methods · Schoch’s beam, {title}"),
        about: format!(
            "A beam of 30 × 60 × 200 mm (E = 300 kPa, ν = 0.35), held at its base and cut through to half its \
             depth. {how} and opens the cut. All meshes have {cells}×{y}×{} cells of five tetrahedra. That \
             of `precut` has faces where the cut is; for `xfem` and `snap` the plane of the cut lies a third \
             of a cell inside, and so does its front; for `xfem-front` and `snap-front` only the plane does.",
            2 * half_z
        ),
        scene: load(include_str!("../../cases/r2-tc1.toml"), &overrides),
        bodies: body.to_vec(),
        protocol: Protocol::Static,
        fewest_frames: 0,
        notes: Vec::new(),
        goal: Goal::new("deflection of the tip", gold.probe("tip_mid"), goal),
        truth: gold.truth("stvk", None, "Stored solution for St. Venant–Kirchhoff"),
        blocks: vec![
            Block::of(&[(Factor::Cutting, &METHODS), (Factor::Law, &["linear", "corotational", "stvk"])]),
            Block(vec![(Factor::Cutting, names(&METHODS)), (Factor::Tolerance, names(&["1e-2", "1e-8"]))]),
        ],
        axes,
        colour: Factor::Cutting,
        shape: Factor::Law,
    }
}

/// Stored solutions of the beam.
pub fn gold(pull: Pull) -> Gold {
    Gold::read(match pull {
        Pull::Gravity => include_str!("../../cases/r2-tc1.gold.json"),
        Pull::Force => include_str!("../../cases/r2-tc2force.gold.json"),
        Pull::Strip => include_str!("../../cases/r2-tc2strip.gold.json"),
    })
}

/// The base of the beam is held.
const BASE: &str = "{ where = { box = { min_m = [-1, -1, -1], max_m = [1, 1, 1e-6] } } }";
/// A strip of the free end, on the side of the cut.
const STRIP: &str = "where = { box = { min_m = [-1, -1, 0.199999], max_m = [0.005001, 1, 1] } }";
const WEIGHTLESS: &str = "world.gravity_m_s2=[0.0, 0.0, 0.0]";

/// Overrides that set loads and constraints instead of gravity.
pub fn pulled(pull: Pull) -> Vec<String> {
    let weightless = WEIGHTLESS.to_owned();
    match pull {
        Pull::Gravity => Vec::new(),
        Pull::Force => {
            vec![weightless, format!("body.beam.load=[{{ {STRIP}, force_n = [0, 0, 5], share = \"area\" }}]")]
        }
        Pull::Strip => vec![
            weightless,
            format!("body.beam.fix=[{BASE}, {{ {STRIP}, axes = \"z\", displacement_m = [0, 0, 0.02] }}]"),
        ],
    }
}

/// Overrides that move two strips of the free end instead of gravity: the one of [`Pull::Strip`] by `part` of 20 mm along
/// the beam, the one opposite by `part` of 30 mm outwards and 15 mm back.
pub fn strips(part: f64) -> Vec<String> {
    let other = "where = { box = { min_m = [0.024999, -1, 0.199999], max_m = [1, 1, 1] } }";
    let [along, out, back] = [0.02, 0.03, -0.015].map(|u| part * u);
    let fix = format!(
        "body.beam.fix=[{BASE}, {{ {STRIP}, axes = \"z\", displacement_m = [0, 0, {along:?}] }}, \
         {{ {other}, axes = \"xz\", displacement_m = [{out:?}, 0, {back:?}] }}]"
    );
    vec![WEIGHTLESS.to_owned(), fix]
}

/// The mesh of the beam as a table of a scene: lines `x_m` [m] across it, one of them at 0.015, `y` cells through it and
/// `half_z` below and above the cut.
pub fn beam_mesh(x_m: &[f64], y: usize, half_z: usize, inside: Inside) -> String {
    let y_m: Vec<f64> = (0..=y).map(|j| 0.06 * j as f64 / y as f64).collect();
    let n = half_z as f64;
    let z_m: Vec<f64> = if inside.plane {
        // The cut at z = 0.1 lies a third of a cell above line half_z.
        let dz = 0.1 / (n + 1.0 / 3.0);
        let below = (0..=half_z).map(|k| dz * k as f64);
        below.chain((1..=half_z).map(|k| dz * n + (0.2 - dz * n) * k as f64 / n)).collect()
    } else {
        (0..=2 * half_z).map(|k| 0.1 * k as f64 / n).collect()
    };
    let mut x_m = x_m.to_vec();
    if inside.front {
        // The front at x = 0.015 lies a third of a cell before a line.
        let front = x_m.iter().position(|x| (x - 0.015).abs() < 1e-9).unwrap_or(1);
        x_m[front] += (x_m[front] - x_m[front - 1]) / 3.0;
    }
    format!("{{ grid = {{ x_m = {x_m:?}, y_m = {y_m:?}, z_m = {z_m:?}, pattern = \"tet5\" }} }}")
}

/// The axis of cutting methods, each with its mesh.
fn methods(body: &[String], x_m: &[f64], y: usize, half_z: usize) -> Axis {
    let setting = |(i, label): (usize, &&str)| {
        let inside = match *label {
            "precut" => Inside::NOTHING,
            "xfem" | "snap" => Inside { plane: true, front: true },
            _ => Inside { plane: true, front: false },
        };
        let mut set = on_bodies(body, "mesh", &beam_mesh(x_m, y, half_z, inside));
        let method = if label.starts_with("snap") { "snap" } else { "xfem" };
        set.extend(on_bodies(body, "cutting.method", &format!("\"{method}\"")));
        Setting::new(*label, i as f64, set)
    };
    Axis::new(Factor::Cutting, METHODS.iter().chain(&FRONTS).enumerate().map(setting).collect(), "xfem")
}

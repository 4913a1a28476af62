//! Images on skins: their coordinates on every kind of mesh and after cuts, and what is refused.

use std::f64::consts::{PI, TAU};
use std::fs;

use nalgebra::Vector3;
use scindo_world::inputs::{Inputs, Wants};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::{BodySnapshot, Snapshot};

/// Two by two pixels.
const PNG: &[u8] = include_bytes!("../../../../tests/browser/quarters.png");

const SIDE: f64 = 0.1;

/// A cube whose corners lie on the image as they are seen from above: u = x, v = y in parts of the side.
fn cube() -> String {
    let corner = |i: usize| [0, 1, 2].map(|axis| (i >> axis & 1) as f64);
    let mut text = String::new();
    for [x, y, z] in (0..8).map(corner) {
        text += &format!("v {} {} {}\n", SIDE * x, SIDE * y, SIDE * z);
    }
    for [x, y, _] in (0..8).map(corner) {
        text += &format!("vt {x} {y}\n");
    }
    for face in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
        text += &format!("f{}\n", face.map(|v| format!(" {v}/{v}")).concat());
    }
    text
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("skin.png"), PNG).unwrap();
    fs::write(folder.path().join("cube.obj"), cube()).unwrap();
    fs::write(folder.path().join("bare.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(folder.path().join("text.png"), "no image").unwrap();
    fs::write(folder.path().join("torn.png"), &PNG[..12]).unwrap();
    folder
}

fn scene(body: &str, texture: &str) -> Scene {
    let text = format!(
        "schema = 1\nname = \"textured\"\n[world]\nstep_s = 0.01\n[[body]]\nid = \"cube\"\n{body}\n\
         young_pa = 1e4\npoisson = 0.4\ndensity_kg_m3 = 1000\nrayleigh = {{ mass_1_s = 5 }}\n\
         look = {{ texture = {{ {texture} }} }}\n"
    );
    let cut = "[[cut]]\nbody = \"cube\"\nat_s = 0.005\n\
         sweep_m = [[[-0.01, 0.048, 0.04], [-0.01, 0.048, 0.12]], [[0.065, 0.048, 0.04], [0.065, 0.048, 0.12]]]\n";
    let text = if body == HEX { text } else { text + cut };
    Scene::from_toml(&text).unwrap()
}

fn shown(simulation: &mut Simulation) -> BodySnapshot {
    let mut snapshot = Snapshot::default();
    simulation.snapshot_into(&Wants { surface: vec![true], ..Wants::default() }, &mut snapshot);
    snapshot.bodies.remove(0)
}

const BOX: &str =
    "mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [6, 6, 6], pattern = \"tet5\" } }";
const HEX: &str = "mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [6, 6, 6], pattern = \"hex\" } }\n\
    element = \"hex8\"";
const LATTICE: &str = "mesh = { surface = \"cube.obj\", cells = 8 }";
const SKIN: &str = "mesh = { surface = \"cube.obj\", cells = 8 }\nskin = { divisions = 3 }";
const OWN: &str = "mesh = { surface = \"cube.obj\", cells = 8 }\nskin = { triangles = \"own\" }";
const OCTREE: &str =
    "mesh = { surface = \"cube.obj\", cells = 12 }\nelement = \"octree\"\nlaw = \"corotational\"";

/// Furthest that a corner of the skin lies from its place on the image, in sides of the image.
fn error(body: &BodySnapshot) -> f64 {
    let found = body.topology.on_image(body.texture.as_ref().unwrap());
    let skin = body.topology.tags.iter().filter(|tag| **tag == 0).count();
    assert_eq!(found.len(), skin);
    let triangles = body.topology.triangles.iter().zip(&body.topology.tags).filter(|(_, tag)| **tag == 0);
    let corners = triangles.flat_map(|(t, _)| t.map(|v| body.topology.rest[v as usize]));
    let corners = corners.zip(found.into_iter().flatten());
    let away = corners.map(|(rest, on)| {
        (0..2)
            .map(|k| (f64::from(rest[k]) / SIDE).clamp(0.0, 1.0) - f64::from(on[k]))
            .fold(0.0, |a: f64, b| a.max(b.abs()))
    });
    away.fold(0.0, f64::max)
}

#[test]
fn the_image_lies_where_it_belongs_on_every_mesh_and_stays_there_when_it_is_cut() {
    let folder = folder();
    let own = "image = \"skin.png\"";
    let given = "image = \"skin.png\", surface = \"cube.obj\"";
    for (body, texture, bound) in [
        (BOX, given, 1e-5),
        (HEX, given, 1e-5),
        (LATTICE, own, 1e-5),
        (SKIN, own, 1e-5),
        (OWN, own, 1e-5),
        (OCTREE, own, 0.02),
    ] {
        let mut simulation = Simulation::new(&scene(body, texture), folder.path()).unwrap();
        let before = shown(&mut simulation);
        assert!(before.topology.tags.iter().all(|tag| *tag == 0), "{body}");
        assert!(error(&before) < bound, "{body}: {}", error(&before));
        for _ in 0..5 {
            simulation.step(&Inputs::default());
        }
        let after = shown(&mut simulation);
        if body != HEX {
            assert!(after.topology.tags.iter().any(|tag| *tag != 0), "{body}: it is cut");
        }
        assert!(error(&after) < bound, "{body}, cut: {}", error(&after));
    }
}

/// A ball whose image is a map of the world: u = longitude with a seam at 0, v = latitude with a pole at each end.
struct Globe {
    corners: Vec<[Vector3<f64>; 3]>,
    coordinates: Vec<[[f64; 2]; 3]>,
}

impl Globe {
    fn new(around: usize, up: usize) -> Self {
        let mut globe = Self { corners: Vec::new(), coordinates: Vec::new() };
        let at = |i: usize, j: usize| {
            let (u, v) = (i as f64 / around as f64, j as f64 / up as f64);
            let (longitude, latitude) = (TAU * (i % around) as f64 / around as f64, PI * (v - 0.5));
            let flat = if j == 0 || j == up { 0.0 } else { latitude.cos() };
            let x = Vector3::new(flat * longitude.cos(), flat * longitude.sin(), latitude.sin());
            (0.5 * SIDE * (x + Vector3::repeat(1.0)), [u, v])
        };
        for (i, j) in (0..around).flat_map(|i| (0..up).map(move |j| (i, j))) {
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let mut add = |three: [(Vector3<f64>, [f64; 2]); 3]| {
                globe.corners.push(three.map(|(x, _)| x));
                globe.coordinates.push(three.map(|(_, uv)| uv));
            };
            if j > 0 {
                add([p, q, r]);
            }
            if j + 1 < up {
                add([p, r, s]);
            }
        }
        globe
    }

    fn obj(&self) -> String {
        let mut text = String::new();
        for (x, [u, v]) in self.corners.iter().flatten().zip(self.coordinates.iter().flatten()) {
            text += &format!("v {} {} {}\nvt {u} {v}\n", x.x, x.y, x.z);
        }
        for t in 0..self.corners.len() {
            let [a, b, c] = [1, 2, 3].map(|k| 3 * t + k);
            text += &format!("f {a}/{a} {b}/{b} {c}/{c}\n");
        }
        text
    }

    /// Furthest that a corner of the skin lies from its place on the image, and off the surface [m].
    fn errors(&self, body: &BodySnapshot) -> [f64; 2] {
        let found = body.topology.on_image(body.texture.as_ref().unwrap());
        let triangles = body.topology.triangles.iter().zip(&body.topology.tags).filter(|(_, tag)| **tag == 0);
        let mut errors = [0.0_f64; 2];
        for ((triangle, _), on) in triangles.zip(found) {
            let x = triangle.map(|v| Vector3::from(body.topology.rest[v as usize].map(f64::from)));
            let centre = (x[0] + x[1] + x[2]) / 3.0;
            let weights = |t: usize, x: &Vector3<f64>| {
                let [a, b, c] = self.corners[t];
                let n = (b - a).cross(&(c - a));
                let part =
                    |p: Vector3<f64>, q: Vector3<f64>| (p - x).cross(&(q - x)).dot(&n) / n.norm_squared();
                ([part(b, c), part(c, a), part(a, b)], (x - a).dot(&n.normalize()).abs())
            };
            // The triangle of the globe that the centre is in.
            let inside = |&t: &usize| {
                let (w, off) = weights(t, &centre);
                w.iter().copied().fold(f64::INFINITY, f64::min) - off / SIDE
            };
            let t = (0..self.corners.len()).max_by(|s, t| inside(s).total_cmp(&inside(t))).unwrap();
            for (x, on) in x.iter().zip(on) {
                let (w, off) = weights(t, x);
                let exact = [0, 1].map(|k| (0..3).map(|c| w[c] * self.coordinates[t][c][k]).sum::<f64>());
                let away = (0..2).map(|k| (exact[k] - f64::from(on[k])).abs()).fold(0.0, f64::max);
                errors = [errors[0].max(away), errors[1].max(off)];
            }
        }
        errors
    }
}

#[test]
fn a_skin_of_own_triangles_shows_the_image_exactly_even_beside_a_seam() {
    let globe = Globe::new(20, 10);
    let folder = folder();
    fs::write(folder.path().join("globe.obj"), globe.obj()).unwrap();
    let mesh = "mesh = { surface = \"globe.obj\", cells = 8 }\n";
    let own = format!("{mesh}skin = {{ triangles = \"own\" }}");
    let mut simulation = Simulation::new(&scene(&own, "image = \"skin.png\""), folder.path()).unwrap();
    let kept = simulation.bodies()[0].body.skin().unwrap().kept().unwrap();
    assert_eq!(kept.triangles, 20 * 2 * 9);
    assert_eq!(kept.of, kept.triangles);
    let [image, shape] = globe.errors(&shown(&mut simulation));
    assert!(image < 1e-5 && shape < 1e-8, "{image} of the image, {shape} m");
    for _ in 0..5 {
        simulation.step(&Inputs::default());
    }
    let after = shown(&mut simulation);
    assert!(after.topology.tags.iter().any(|tag| *tag != 0), "it is cut");
    let [image, shape] = globe.errors(&after);
    assert!(image < 1e-5 && shape < 1e-8, "{image} of the image, {shape} m, cut");
    // So does one on cells.
    let cells = format!("{own}\nelement = \"octree\"");
    let mut simulation = Simulation::new(&scene(&cells, "image = \"skin.png\""), folder.path()).unwrap();
    assert_eq!(simulation.bodies()[0].body.kept().unwrap().triangles, kept.of);
    let [image, shape] = globe.errors(&shown(&mut simulation));
    assert!(image < 1e-5 && shape < 1e-8, "{image} of the image, {shape} m, on cells");
    // A divided skin only comes near.
    let divided = format!("{mesh}skin = {{ divisions = 2 }}");
    let mut simulation = Simulation::new(&scene(&divided, "image = \"skin.png\""), folder.path()).unwrap();
    let [image, shape] = globe.errors(&shown(&mut simulation));
    assert!(image > 1e-3 && shape > 1e-5, "{image} of the image, {shape} m");
}

#[test]
fn an_image_survives_a_checkpoint() {
    let folder = folder();
    let mut simulation = Simulation::new(&scene(LATTICE, "image = \"skin.png\""), folder.path()).unwrap();
    let state = simulation.checkpoint().unwrap();
    simulation.step(&Inputs::default());
    simulation.restore(&state).unwrap();
    let body = shown(&mut simulation);
    assert_eq!(body.texture.as_ref().unwrap().image.bytes[..], *PNG);
    assert!(error(&body) < 1e-5);
}

#[test]
fn what_is_wrong_with_an_image_is_said_with_its_key() {
    let folder = folder();
    for (body, texture, key, words) in [
        (LATTICE, "image = \"none.png\"", "image", "check the path"),
        (LATTICE, "image = \"text.png\"", "image", "no PNG and no JPEG"),
        (LATTICE, "image = \"torn.png\"", "image", "save it again"),
        (LATTICE, "image = \"cube.obj\"", "image", "no PNG and no JPEG"),
        (BOX, "image = \"skin.png\"", "surface", "add `surface`"),
        (BOX, "image = \"skin.png\", surface = \"bare.obj\"", "surface", "line 4"),
        (BOX, "image = \"skin.png\", surface = \"skin.png\"", "surface", "an .obj file"),
        (BOX, "image = \"skin.png\", surface = \"none.obj\"", "surface", "check the path"),
    ] {
        let error = Simulation::new(&scene(body, texture), folder.path()).unwrap_err().to_string();
        assert!(error.contains(&format!("body.cube.look.texture.{key}")) && error.contains(words), "{error}");
    }
    let text = |texture: &str| {
        format!(
            "schema = 1\n[[body]]\nid = \"a\"\n{BOX}\nyoung_pa = 1e4\npoisson = 0.4\ndensity_kg_m3 = 1000\n\
             look = {{ texture = {{ image = \"a.png\", {texture} }} }}\n"
        )
    };
    for (texture, key) in [
        ("surface = \"a.obj\", repeat_m = 0.1", "repeat_m"),
        ("scale = 2.0", "scale"),
        ("repeat_m = 0.0", "repeat_m"),
        ("repeat = 0.1", "repeat"),
    ] {
        let error = Scene::from_toml(&text(texture)).unwrap_err().to_string();
        assert!(error.contains(&format!("look.texture.{key}")) || error.contains("repeat_m"), "{error}");
    }
    assert!(Simulation::new(&scene(BOX, "image = \"skin.png\", repeat_m = 0.05"), folder.path()).is_ok());
}

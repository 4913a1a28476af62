//! Scenes for tests, as text: parts that are put one after another, such as
//! `[WORLD, &block("block", [[0.0; 3], [0.1; 3]], [6; 3], &held("z")), FLOOR].concat()`.

/// The head of a scene: gravity downwards, steps of 10 ms.
pub const WORLD: &str = "schema = 1\nworld = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }\n";

/// A floor at z = 0.
pub const FLOOR: &str =
    "[[obstacle]]\nid = \"floor\"\nhalf_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }\n";

/// What a block is made of unless its keys say otherwise: soft tissue.
const TISSUE: [&str; 3] = ["young_pa = 2e4", "poisson = 0.4", "density_kg_m3 = 1000"];

/// A body that fills a box between two corners [m] with equal cells, and what else it says of itself (`keys`).
#[must_use]
pub fn block(id: &str, [min, max]: [[f64; 3]; 2], cells: [u32; 3], keys: &str) -> String {
    let mut text = format!(
        "[[body]]\nid = \"{id}\"\nmesh = {{ box = {{ min_m = {min:?}, max_m = {max:?}, cells = {cells:?} }} }}\n"
    );
    for line in TISSUE {
        let key = line.split(' ').next().unwrap_or(line);
        if !keys.lines().any(|given| given.trim_start().starts_with(key)) {
            text += line;
            text.push('\n');
        }
    }
    text + keys + "\n"
}

/// The key of a body that is held where `axis` is least.
#[must_use]
pub fn held(axis: &str) -> String {
    format!("fix = [{{ where = {{ slab = {{ axis = \"{axis}\", from = 0, to = 0 }} }} }}]\n")
}

/// A cut through `body` at a time [s]: from one place of a blade, which is a segment [m], to the next.
#[must_use]
pub fn cut(body: &str, at_s: f64, sweep_m: [[[f64; 3]; 2]; 2]) -> String {
    format!("[[cut]]\nbody = \"{body}\"\nat_s = {at_s:?}\nsweep_m = {sweep_m:?}\n")
}

/// A probe of the material at a point [m] of `body`.
#[must_use]
pub fn probe(id: &str, body: &str, point_m: [f64; 3]) -> String {
    format!("[[probe]]\nid = \"{id}\"\nbody = \"{body}\"\npoint_m = {point_m:?}\n")
}

/// A ball of a radius [m] that is at these times [s] at these places [m]; without any it stays away.
#[must_use]
pub fn ball(id: &str, radius_m: f64, path: &[(f64, [f64; 3])]) -> String {
    let at = |(at_s, tip_m): &(f64, [f64; 3])| format!("{{ at_s = {at_s:?}, tip_m = {tip_m:?} }}");
    let path = path.iter().map(at).collect::<Vec<_>>().join(", ");
    let path = if path.is_empty() { path } else { format!("path = [{path}]\n") };
    format!("[[tool]]\nid = \"{id}\"\nshape = {{ sphere = {{ radius_m = {radius_m:?} }} }}\n{path}")
}

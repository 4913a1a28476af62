//! Meshes of a scene, refined and coarsened by a factor.
//!
//! A user sets a number of cells ([`cells`]). The reference needs more: regions that hold or load a body, and
//! fronts of cuts, must be the same on every mesh. A block is therefore made from explicit coordinates. The
//! nearest of them are moved onto the faces of those regions ([`aligned`]).

use scindo_world::scene::raw::RawElement;
use scindo_world::scene::{BodySpec, CellSplit, CheckedScene, CutPath, MeshSource, Region};

use super::subdivide::Subdivisions;
use crate::design::axes::Setting;

/// Factors tried for levels, about √2 apart.
pub(super) const FACTORS: [f64; 10] = [0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0];

/// Largest ratio of a level to its factor, and largest logarithmic unevenness of its cells along the axes.
const ROOM: f64 = 1.15;
const UNEVEN: f64 = 0.07;

/// Coordinates closer to a face of a block than this fraction of a cell lie on it.
const ON_FACE: f64 = 0.05;

/// Levels that refine the scene evenly, coarse to fine. `make` builds the setting for a factor.
pub(super) fn levels(scene: &CheckedScene, make: &dyn Fn(f64) -> Option<Setting>) -> Vec<Setting> {
    let mut found: Vec<Setting> = Vec::new();
    for setting in FACTORS.iter().filter_map(|target| make(even(scene, *target)?)) {
        if found.last().is_none_or(|last| setting.size > 1.1 * last.size) {
            found.push(setting);
        }
    }
    found
}

/// The factor near `target` that rounds the cells along every axis most evenly; `None` if none does.
fn even(scene: &CheckedScene, target: f64) -> Option<f64> {
    let counts: Vec<f64> = scene.bodies.iter().flat_map(|body| counts(&body.mesh)).collect();
    let unevenness = |factor: f64| {
        let off = |n: &f64| ((n * factor).round().max(1.0) / (n * factor)).ln().abs();
        counts.iter().map(off).fold(0.0, f64::max)
    };
    let exact = std::iter::once(target);
    let near = (-20..=20).map(|i| target * ROOM.powf(f64::from(i) / 20.0));
    let best = exact.chain(near).min_by(|a, b| {
        // Of equally even factors the nearest to the target wins.
        let rank = |f: f64| unevenness(f) + 0.02 * (f / target).ln().abs();
        rank(*a).total_cmp(&rank(*b))
    })?;
    (unevenness(best) <= UNEVEN).then_some(best)
}

/// Cells of a mesh along its axes; empty for a file.
fn counts(mesh: &MeshSource) -> Vec<f64> {
    match mesh {
        MeshSource::Box { cells, .. } => cells.map(|n| n as f64).to_vec(),
        MeshSource::Grid { lines_m, .. } => lines_m.iter().map(|lines| (lines.len() - 1) as f64).collect(),
        MeshSource::Surface { cells, .. } | MeshSource::Organ { cells, .. } => vec![*cells as f64],
        MeshSource::File { .. } => Vec::new(),
    }
}

/// Smallest and largest number of cells that the scene's format allows.
fn range(mesh: &MeshSource) -> [usize; 2] {
    match mesh {
        MeshSource::Surface { .. } => [2, 256],
        MeshSource::Organ { .. } => [4, 128],
        _ => [1, 1000],
    }
}

/// All meshes with their cells times `factor`, as a user would write them. The size of the setting is the
/// factor after rounding, from the cube root of the number of cells. `None` if nothing changes or a body does
/// not allow it.
pub(super) fn cells(scene: &CheckedScene, files: &Subdivisions, factor: f64) -> Option<Setting> {
    refined(scene, files, factor, &|body, counts| match &body.mesh {
        MeshSource::Box { .. } => Some(format!("body.{}.mesh.box.cells={counts:?}", body.id)),
        MeshSource::Grid { lines_m, .. } => {
            let axis = |i: usize| format!("{}_m={:?}", ["x", "y", "z"][i], resampled(&lines_m[i], counts[i]));
            Some(
                (0..3)
                    .map(|i| format!("body.{}.mesh.grid.{}", body.id, axis(i)))
                    .collect::<Vec<_>>()
                    .join("\n"),
            )
        }
        MeshSource::Surface { .. } => Some(format!("body.{}.mesh.cells={}", body.id, counts[0])),
        MeshSource::Organ { .. } => Some(format!("body.{}.mesh.organ.cells={}", body.id, counts[0])),
        MeshSource::File { .. } => None,
    })
}

/// Like [`cells`], with blocks whose coordinates lie on the faces of all regions of the scene. `split`
/// decides how their cells are split. Octree cells stay cubes. `None` if there are too few cells for the faces.
pub(super) fn aligned(
    scene: &CheckedScene,
    files: &Subdivisions,
    factor: f64,
    split: Split,
) -> Option<Setting> {
    refined(scene, files, factor, &|body, counts| match &body.mesh {
        MeshSource::Box { .. } if split.keeps_cubes(body) => {
            Some(format!("body.{}.mesh.box.cells={counts:?}", body.id))
        }
        MeshSource::Box { min_m, max_m, split: own, .. } => {
            let even = |i: usize| {
                let (n, low, high) = (counts[i], min_m[i], max_m[i]);
                (0..=n).map(|k| low + (high - low) * k as f64 / n as f64).collect::<Vec<f64>>()
            };
            grid(scene, body, [even(0), even(1), even(2)], split.pattern(*own))
        }
        MeshSource::Grid { lines_m, split: own } => {
            let lines = [0, 1, 2].map(|i| resampled(&lines_m[i], counts[i]));
            grid(scene, body, lines, split.pattern(*own))
        }
        MeshSource::Surface { .. } => Some(format!("body.{}.mesh.cells={}", body.id, counts[0])),
        MeshSource::Organ { .. } => Some(format!("body.{}.mesh.organ.cells={}", body.id, counts[0])),
        MeshSource::File { .. } => None,
    })
}

/// Like [`aligned`], but coordinates stay where they are, wherever regions end.
pub(super) fn uneven(
    scene: &CheckedScene,
    files: &Subdivisions,
    factor: f64,
    split: Split,
) -> Option<Setting> {
    let mut setting = cells(scene, files, factor)?;
    for body in &scene.bodies {
        let (kind, own) = match &body.mesh {
            MeshSource::Box { .. } if split.keeps_cubes(body) => continue,
            MeshSource::Box { split, .. } => ("box", *split),
            MeshSource::Grid { split, .. } => ("grid", *split),
            _ => continue,
        };
        setting.set.push(format!("body.{}.mesh.{kind}.pattern=\"{}\"", body.id, split.pattern(own)));
    }
    Some(setting)
}

/// How the cells of a block are split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Split {
    /// As the scene says.
    Own,
    /// Into tetrahedra: as the scene says, otherwise six per cell.
    Tets,
}

impl Split {
    /// Whether a body keeps its octree cells.
    fn keeps_cubes(self, body: &BodySpec) -> bool {
        self == Split::Own && body.mechanics.element == RawElement::Octree
    }

    fn pattern(self, own: CellSplit) -> &'static str {
        match (self, own) {
            (Split::Own, CellSplit::Hex) => "hex",
            (Split::Tets, CellSplit::Hex) | (_, CellSplit::Six) => "tet6",
            (_, CellSplit::Five) => "tet5",
            (_, CellSplit::Octahedral) => "oct6",
        }
    }
}

/// Builds a setting body by body. `key` gives the override for a body and its cells.
fn refined(
    scene: &CheckedScene,
    files: &Subdivisions,
    factor: f64,
    key: &dyn Fn(&BodySpec, &[usize]) -> Option<String>,
) -> Option<Setting> {
    let mut set = Vec::new();
    let mut labels = Vec::new();
    let mut finer = Vec::new();
    for (i, body) in scene.bodies.iter().enumerate() {
        if let MeshSource::File { .. } = body.mesh {
            if let Some(level) = files.level(i, factor) {
                set.extend(level.overrides(&body.id));
                labels.push(format!("{} elements", level.tets));
                finer.push(level.factor);
            }
            continue;
        }
        let own = counts(&body.mesh);
        let [least, most] = range(&body.mesh);
        let new: Vec<usize> = own.iter().map(|n| ((n * factor).round() as usize).max(1)).collect();
        if new.iter().any(|n| !(least..=most).contains(n)) {
            return None;
        }
        let ratio: f64 = new.iter().zip(&own).map(|(n, o)| *n as f64 / o).product();
        finer.push(ratio.powf(1.0 / own.len() as f64));
        set.extend(key(body, &new)?.lines().map(str::to_owned));
        labels.push(match new.as_slice() {
            [n] => format!("{n} cells"),
            sides => sides.iter().map(ToString::to_string).collect::<Vec<_>>().join("×"),
        });
    }
    let size = (finer.iter().map(|f: &f64| f.ln()).sum::<f64>() / finer.len().max(1) as f64).exp();
    (!set.is_empty() || factor == 1.0).then(|| Setting::new(labels.join(" and "), size, set))
}

/// Divides the range of `lines` into `n` intervals with the same grading.
fn resampled(lines: &[f64], n: usize) -> Vec<f64> {
    let last = lines.len() - 1;
    let at = |k: usize| {
        let place = k as f64 * last as f64 / n as f64;
        let i = (place.floor() as usize).min(last - 1);
        lines[i] + (place - i as f64) * (lines[i + 1] - lines[i])
    };
    (0..n).map(at).chain(lines.last().copied()).collect()
}

/// The override that makes a body's mesh from coordinates, moved onto the faces of its regions. `None` if
/// there are too few coordinates.
fn grid(scene: &CheckedScene, body: &BodySpec, mut lines: [Vec<f64>; 3], pattern: &str) -> Option<String> {
    for (axis, lines) in lines.iter_mut().enumerate() {
        let ends = [lines[0], lines[lines.len() - 1]];
        if !snap(lines, &faces(scene, body, axis, ends)) {
            return None;
        }
    }
    let [x, y, z] = lines;
    Some(format!(
        "body.{}.mesh={{ grid = {{ x_m = {x:?}, y_m = {y:?}, z_m = {z:?}, pattern = \"{pattern}\" }} }}",
        body.id
    ))
}

/// Where regions of a body and cuts through it end along an axis [m].
fn faces(scene: &CheckedScene, body: &BodySpec, axis: usize, [low, high]: [f64; 2]) -> Vec<f64> {
    let regions = body.fixes.iter().map(|f| &f.region).chain(body.loads.iter().map(|l| &l.region));
    let mut faces: Vec<f64> = regions
        .flat_map(|region| match region {
            Region::Box { min_m, max_m } => vec![min_m[axis], max_m[axis]],
            Region::Slab { axis: along, from, to } if *along == axis => {
                vec![low + from * (high - low), low + to * (high - low)]
            }
            _ => Vec::new(),
        })
        .collect();
    let index = scene.bodies.iter().position(|other| other.id == body.id);
    for cut in scene.cuts.iter().filter(|cut| Some(cut.body) == index) {
        let CutPath::Sweep(segments) = &cut.blade else { continue };
        let along = || segments.iter().flatten().map(|point| point[axis]);
        let ends = [along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max)];
        // A flat sweep may lie anywhere, but an end inside the body is a front.
        if ends[1] - ends[0] > 1e-6 * (high - low) {
            faces.extend(ends);
        }
    }
    faces.retain(|face| face.is_finite() && *face > low && *face < high);
    faces.sort_by(f64::total_cmp);
    faces.dedup();
    faces
}

/// Moves the nearest inner coordinate onto each face. Ends and order stay. False if a face remains.
fn snap(lines: &mut [f64], faces: &[f64]) -> bool {
    let n = lines.len() - 1;
    let mut taken = vec![false; n + 1];
    for &face in faces {
        let cell = lines.partition_point(|line| *line < face).clamp(1, n);
        let width = lines[cell] - lines[cell - 1];
        if (face - lines[0]).min(lines[n] - face) < ON_FACE * width {
            continue;
        }
        let nearest = if face - lines[cell - 1] < lines[cell] - face { cell - 1 } else { cell };
        let inner = nearest.clamp(1, n.max(2) - 1);
        if n < 2 || taken[inner] || face <= lines[inner - 1] || face >= lines[inner + 1] {
            return false;
        }
        lines[inner] = face;
        taken[inner] = true;
    }
    true
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use scindo_world::scene::Scene;

    fn scene(mesh: &str, rest: &str) -> Scene {
        Scene::from_toml(&format!(
            "schema = 1\n[[body]]\nid = \"b\"\nmesh = {mesh}\nyoung_pa = 1e5\npoisson = 0.3\n\
             density_kg_m3 = 1000\n{rest}"
        ))
        .unwrap()
    }

    #[test]
    fn levels_keep_the_shape_of_cells() {
        let scene = scene("{ box = { min_m = [0,0,0], max_m = [1,0.1,0.1], cells = [10,1,1] } }", "");
        let files = Subdivisions::default();
        let found = levels(scene.checked(), &|f| cells(scene.checked(), &files, f));
        let labels: Vec<&str> = found.iter().map(|s| s.label.as_str()).collect();
        assert_eq!(labels[..3], ["10×1×1", "20×2×2", "30×3×3"]);
        assert!((found[1].size - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_grid_is_refined_between_its_coordinates() {
        let own = [0.0, 1.0, 3.0];
        assert_eq!(resampled(&own, 4), [0.0, 0.5, 1.0, 2.0, 3.0]);
        assert_eq!(resampled(&own, 1), [0.0, 3.0]);
    }

    #[test]
    fn coordinates_move_onto_faces_of_regions() {
        let mut lines = [0.0, 0.25, 0.5, 0.75, 1.0];
        assert!(snap(&mut lines, &[1e-6, 0.3, 0.9999999]));
        assert_eq!(lines, [0.0, 0.3, 0.5, 0.75, 1.0]);
        let mut two = [0.0, 1.0];
        assert!(!snap(&mut two, &[0.4]), "a single cell has no inner coordinate");
    }

    #[test]
    fn an_aligned_block_selects_the_region_itself() {
        let scene = scene(
            "{ box = { min_m = [0,0,0], max_m = [1,1,1], cells = [4,4,4], pattern = \"hex\" } }",
            "element = \"hex8\"\n[[body.fix]]\nwhere = { box = { min_m = [-1,-1,-1], max_m = [2,2,0.3] } }",
        );
        let files = Subdivisions::default();
        for (split, pattern) in [(Split::Own, "hex"), (Split::Tets, "tet6")] {
            let setting = aligned(scene.checked(), &files, 2.0, split).unwrap();
            // Eight cells: the coordinate nearest to the face of the region has moved onto it.
            assert!(setting.set[0].contains("0.125, 0.3, 0.375"), "{}", setting.set[0]);
            assert!(setting.set[0].contains(pattern), "{}", setting.set[0]);
        }
    }

    #[test]
    fn octree_cells_stay_cubes() {
        let mesh = "{ box = { min_m = [0,0,0], max_m = [1,1,0.5], cells = [8,8,4] } }";
        let fixed = "[[body.fix]]\nwhere = { box = { min_m = [-1,-1,-1], max_m = [2,2,0.3] } }";
        let scene = scene(mesh, &format!("element = \"octree\"\n{fixed}"));
        let files = Subdivisions::default();
        for make in [aligned, uneven] {
            let own = make(scene.checked(), &files, 2.0, Split::Own).unwrap();
            assert_eq!(own.set, ["body.b.mesh.box.cells=[16, 16, 8]"]);
            assert!(scene.apply_sets(&own.set).is_ok());
            let tets = make(scene.checked(), &files, 2.0, Split::Tets).unwrap();
            assert!(tets.set.concat().contains("tet"), "{tets:?}");
        }
    }

    #[test]
    fn what_the_format_does_not_allow_is_no_level() {
        let scene = scene("{ organ = { cells = 20 } }", "");
        let files = Subdivisions::default();
        assert!(cells(scene.checked(), &files, 0.1).is_none());
        assert!(cells(scene.checked(), &files, 8.0).is_none());
        assert_eq!(cells(scene.checked(), &files, 2.0).unwrap().label, "40 cells");
    }
}

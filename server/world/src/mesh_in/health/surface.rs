//! Cleans a surface from a file, and reports what was wrong with it.
//!
//! Dirty surfaces are accepted, since the lattice only needs inside and outside. Everything found is counted,
//! because the user wants to know that a scan has holes.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

use super::weld;
use crate::format::{MeshInError, SurfaceMesh};
use crate::mesh_in::triangle_tree::TriangleTree;

/// Largest accepted share of triangles without area.
pub(crate) const MAX_DEGENERATE_TRIANGLES: f64 = 0.5;

/// A triangle whose area is below this fraction of (longest edge)² has no direction.
const FLAT_TRIANGLE: f64 = 1e-10;

/// Faults of a surface, counted before and after cleaning.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SurfaceHealth {
    /// Vertices in the file.
    pub vertices: usize,
    /// Triangles in the file (polygons already split).
    pub triangles: usize,
    /// Vertices merged with another at the same place.
    pub welded_vertices: usize,
    /// Triangles without area, removed.
    pub degenerate_triangles: usize,
    /// Triangles on the same three vertices as another one, removed.
    pub duplicate_triangles: usize,
    /// Triangles reversed to agree with their neighbours.
    pub flipped_triangles: usize,
    /// Whether the surface faced inwards and was turned inside out.
    pub was_inside_out: bool,
    /// Connected sheets.
    pub components: usize,
    /// Edges with only one triangle.
    pub boundary_edges: usize,
    /// Holes: connected chains of edges with only one triangle.
    pub holes: usize,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges whose two triangles could not be made to agree, as on a one-sided surface.
    pub one_sided_edges: usize,
    /// Edges that pass through another triangle.
    pub self_intersections: usize,
    /// Enclosed volume [m³]. For an open surface, holes are closed by cones from the middle.
    pub volume_m3: f64,
    /// Smallest corner of the bounding box [m].
    pub min_m: [f64; 3],
    /// Largest corner of the bounding box [m].
    pub max_m: [f64; 3],
}

impl SurfaceHealth {
    /// Whether there are no holes, no edges with more than two triangles and no self-intersections.
    pub fn is_clean(&self) -> bool {
        self.boundary_edges + self.non_manifold_edges + self.one_sided_edges + self.self_intersections == 0
    }
}

/// A welded, consistently outward oriented surface, ready for inside tests.
pub(crate) struct CleanSurface {
    /// Name of the file.
    pub file: String,
    /// Tree for crossings and winding numbers.
    pub tree: TriangleTree,
}

/// Welds vertices, removes useless triangles and orients the rest. `scale` converts the file's unit to
/// metres.
pub(crate) fn clean_surface(
    surface: &SurfaceMesh,
    scale: f64,
) -> Result<(CleanSurface, SurfaceHealth), MeshInError> {
    let mut health = SurfaceHealth {
        vertices: surface.vertices.len(),
        triangles: surface.triangles.len(),
        ..SurfaceHealth::default()
    };
    let used = surface.triangles.iter().flatten().map(|&v| surface.vertices[v as usize] * scale);
    let (low, high) = bounds(used);
    (health.min_m, health.max_m) = (low.into(), high.into());
    let scaled: Vec<Vector3<f64>> = surface.vertices.iter().map(|v| v * scale).collect();
    let (first_of, welded) = weld::coincident(&scaled, 1e-9 * (high - low).norm());
    health.welded_vertices = welded;

    let mut triangles = kept_triangles(surface, &scaled, &first_of, &mut health)?;
    orient(&mut triangles, &scaled, 0.5 * (low + high), &mut health);
    health.volume_m3 = enclosed_volume(&scaled, &triangles, 0.5 * (low + high));
    let tree = TriangleTree::new(&scaled, &triangles);
    health.self_intersections = self_intersections(&scaled, &triangles, &tree);
    Ok((CleanSurface { file: surface.file.clone(), tree }, health))
}

fn bounds(points: impl Iterator<Item = Vector3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let start = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    points.fold(start, |(low, high), p| (low.inf(&p), high.sup(&p)))
}

/// Triangles on welded vertices, without flat and duplicate ones.
fn kept_triangles(
    surface: &SurfaceMesh,
    vertices: &[Vector3<f64>],
    first_of: &[u32],
    health: &mut SurfaceHealth,
) -> Result<Vec<[u32; 3]>, MeshInError> {
    let mut seen = std::collections::BTreeSet::new();
    let mut kept = Vec::with_capacity(surface.triangles.len());
    for triangle in &surface.triangles {
        let t = triangle.map(|v| first_of[v as usize]);
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        let longest_squared = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
        if (b - a).cross(&(c - a)).norm() <= FLAT_TRIANGLE * longest_squared {
            health.degenerate_triangles += 1;
            continue;
        }
        let mut key = t;
        key.sort_unstable();
        if seen.insert(key) {
            kept.push(t);
        } else {
            health.duplicate_triangles += 1;
        }
    }
    let bad = health.degenerate_triangles;
    if kept.is_empty() || bad as f64 > MAX_DEGENERATE_TRIANGLES * surface.triangles.len() as f64 {
        return Err(MeshInError::TooManyDegenerate {
            file: surface.file.clone(),
            element: "triangles",
            bad,
            total: surface.triangles.len(),
            limit_percent: 100.0 * MAX_DEGENERATE_TRIANGLES,
        });
    }
    Ok(kept)
}

/// An undirected edge → its triangles, each with whether it runs from the smaller to the larger vertex.
type EdgeTriangles = BTreeMap<[u32; 2], Vec<(u32, bool)>>;

fn edges_of(triangles: &[[u32; 3]]) -> EdgeTriangles {
    let mut edges = EdgeTriangles::new();
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.entry([a.min(b), a.max(b)]).or_default().push((i as u32, a < b));
        }
    }
    edges
}

/// Makes neighbours agree (the larger area wins) and turns sheets outward. Counts the faults it sees.
fn orient(
    triangles: &mut [[u32; 3]],
    vertices: &[Vector3<f64>],
    middle: Vector3<f64>,
    health: &mut SurfaceHealth,
) {
    // Neighbours over an edge agree if they run through it in opposite directions.
    let edges = edges_of(triangles);
    let mut neighbours: Vec<Vec<(u32, bool)>> = vec![Vec::new(); triangles.len()];
    for sharing in edges.values() {
        match sharing[..] {
            [_] => health.boundary_edges += 1,
            [(a, forward_a), (b, forward_b)] => {
                let disagree = forward_a == forward_b;
                neighbours[a as usize].push((b, disagree));
                neighbours[b as usize].push((a, disagree));
            }
            _ => health.non_manifold_edges += 1,
        }
    }
    health.holes = chains(edges.iter().filter(|(_, s)| s.len() == 1).map(|(e, _)| *e));

    let sheets = sheets(&neighbours, health);
    health.components = sheets.len();
    // Per sheet, reverse the triangles of the orientation with the smaller area.
    for sheet in &sheets {
        let area = |turned: bool| -> f64 {
            let chosen = sheet.iter().filter(|(_, t)| *t == turned);
            chosen.map(|&(i, _)| area_normal(vertices, &triangles[i as usize]).norm()).sum()
        };
        let minority = area(true) <= area(false);
        for &(i, _) in sheet.iter().filter(|(_, turned)| *turned == minority) {
            triangles[i as usize].swap(1, 2);
            health.flipped_triangles += 1;
        }
    }
    turn_outward(triangles, vertices, middle, &sheets, health);
}

/// Reverses everything if it encloses negative volume. Then reverses single sheets that do and that do not
/// lie within another one, since those within one are cavities.
fn turn_outward(
    triangles: &mut [[u32; 3]],
    vertices: &[Vector3<f64>],
    middle: Vector3<f64>,
    sheets: &[Vec<(u32, bool)>],
    health: &mut SurfaceHealth,
) {
    if enclosed_volume(vertices, triangles, middle) < 0.0 {
        health.was_inside_out = true;
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    if sheets.len() == 1 {
        return;
    }
    let members: Vec<Vec<[u32; 3]>> =
        sheets.iter().map(|s| s.iter().map(|&(i, _)| triangles[i as usize]).collect()).collect();
    let boxes: Vec<(Vector3<f64>, Vector3<f64>)> =
        members.iter().map(|m| bounds(m.iter().flatten().map(|&v| vertices[v as usize]))).collect();
    for (s, sheet) in sheets.iter().enumerate() {
        let (low, high) = boxes[s];
        let nested = boxes.iter().enumerate().any(|(o, b)| {
            o != s && b.0.iter().zip(&low).all(|(a, b)| a <= b) && b.1.iter().zip(&high).all(|(a, b)| a >= b)
        });
        if !nested && enclosed_volume(vertices, &members[s], 0.5 * (low + high)) < 0.0 {
            health.flipped_triangles += sheet.len();
            sheet.iter().for_each(|&(i, _)| triangles[i as usize].swap(1, 2));
        }
    }
}

/// Connected sheets over edges with two triangles: (triangle, whether it disagrees with the first one).
fn sheets(neighbours: &[Vec<(u32, bool)>], health: &mut SurfaceHealth) -> Vec<Vec<(u32, bool)>> {
    let mut turned: Vec<Option<bool>> = vec![None; neighbours.len()];
    let mut sheets = Vec::new();
    let mut conflicts = 0;
    for start in 0..neighbours.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let mut sheet = vec![(start as u32, false)];
        let mut next = 0;
        while let Some(&(i, here)) = sheet.get(next) {
            next += 1;
            for &(other, disagree) in &neighbours[i as usize] {
                let there = here ^ disagree;
                match turned[other as usize] {
                    None => {
                        turned[other as usize] = Some(there);
                        sheet.push((other, there));
                    }
                    Some(known) => conflicts += usize::from(known != there),
                }
            }
        }
        sheets.push(sheet);
    }
    health.one_sided_edges = conflicts / 2;
    sheets
}

/// Number of connected groups of edges.
fn chains(edges: impl Iterator<Item = [u32; 2]>) -> usize {
    let mut around: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for [a, b] in edges {
        around.entry(a).or_default().push(b);
        around.entry(b).or_default().push(a);
    }
    let mut count = 0;
    while let Some((_, first)) = around.pop_first() {
        count += 1;
        let mut open = first;
        while let Some(vertex) = open.pop() {
            open.extend(around.remove(&vertex).unwrap_or_default());
        }
    }
    count
}

/// ½ (b − a) × (c − a) [m²].
fn area_normal(vertices: &[Vector3<f64>], triangle: &[u32; 3]) -> Vector3<f64> {
    let [a, b, c] = triangle.map(|v| vertices[v as usize]);
    0.5 * (b - a).cross(&(c - a))
}

/// Volume of the cones from `apex` over all triangles [m³]. For a closed surface this is the enclosed volume.
pub(crate) fn enclosed_volume(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], apex: Vector3<f64>) -> f64 {
    let cone = |t: &[u32; 3]| area_normal(vertices, t).dot(&(vertices[t[0] as usize] - apex)) / 3.0;
    triangles.iter().map(cone).sum()
}

/// Number of edges that pass through a triangle with which they share no vertex.
fn self_intersections(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], tree: &TriangleTree) -> usize {
    let edges: Vec<[u32; 2]> = edges_of(triangles).into_keys().collect();
    let pierces = |&[a, b]: &[u32; 2]| {
        let hits = tree.crossings(&vertices[a as usize], &vertices[b as usize]);
        hits.iter().any(|&(_, t)| triangles[t as usize].iter().all(|v| *v != a && *v != b))
    };
    edges.par_iter().filter(|e| pierces(e)).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_in::shapes::{cube, sphere};

    fn health_of(vertices: Vec<Vector3<f64>>, triangles: Vec<[u32; 3]>) -> SurfaceHealth {
        let surface = SurfaceMesh { file: "test".into(), vertices, triangles, notes: Vec::new() };
        clean_surface(&surface, 1.0).unwrap().1
    }

    #[test]
    fn a_clean_cube_has_nothing_to_report() {
        let (vertices, triangles) = cube();
        let health = health_of(vertices, triangles);
        assert!(health.is_clean() && !health.was_inside_out, "{health:?}");
        assert_eq!((health.components, health.welded_vertices, health.flipped_triangles), (1, 0, 0));
        assert!((health.volume_m3 - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_missing_face_is_one_hole_of_four_edges() {
        let (vertices, mut triangles) = cube();
        triangles.truncate(10);
        let health = health_of(vertices, triangles);
        assert_eq!((health.holes, health.boundary_edges), (1, 4));
    }

    #[test]
    fn turned_doubled_and_flat_triangles_are_mended_and_counted() {
        let (vertices, mut triangles) = cube();
        triangles[3].swap(0, 1);
        triangles[7].swap(0, 1);
        triangles.push([0, 2, 3]);
        triangles.push([4, 4, 5]);
        let health = health_of(vertices.clone(), triangles);
        assert_eq!(
            (health.flipped_triangles, health.duplicate_triangles, health.degenerate_triangles),
            (2, 1, 1)
        );
        assert!(health.is_clean() && (health.volume_m3 - 1.0).abs() < 1e-14);
        let inside_out = cube().1.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let health = health_of(vertices, inside_out);
        assert!(health.was_inside_out && health.volume_m3 > 0.9);
    }

    #[test]
    fn loose_triangles_are_welded() {
        let (vertices, triangles) = sphere(6, 1.0);
        let loose: Vec<Vector3<f64>> = triangles.iter().flatten().map(|&v| vertices[v as usize]).collect();
        let separate = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let health = health_of(loose, separate);
        assert!(health.is_clean(), "{health:?}");
        assert_eq!(health.vertices - health.welded_vertices, 6 * 6 * 6 + 2);
    }

    #[test]
    fn two_overlapping_cubes_intersect_and_are_both_outward() {
        let (mut vertices, mut triangles) = cube();
        let more: Vec<Vector3<f64>> = vertices.iter().map(|v| v + Vector3::new(0.5, 0.4, 0.3)).collect();
        triangles.extend(cube().1.iter().map(|&[a, b, c]| [a + 8, c + 8, b + 8]));
        vertices.extend(more);
        let health = health_of(vertices, triangles);
        assert!(health.self_intersections > 0);
        assert!((health.volume_m3.abs() - 2.0).abs() < 1e-12, "{health:?}");
    }

    #[test]
    fn a_surface_of_nothing_but_flat_triangles_is_refused() {
        let surface = SurfaceMesh {
            file: "flat.stl".into(),
            vertices: vec![Vector3::zeros(), Vector3::x(), 2.0 * Vector3::x()],
            triangles: vec![[0, 1, 2]; 5],
            notes: Vec::new(),
        };
        let message = clean_surface(&surface, 1.0).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains("flat.stl") && message.contains("5 of 5 triangles"), "{message}");
    }
}

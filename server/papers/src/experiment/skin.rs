//! The surface of octree cells beside the surface that a solid was made from.

use nalgebra::Vector3;
use scindo_collision::SurfaceBvh;
use scindo_physics::octree::{Octree, OctreeSettings, OctreeSurface};
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use scindo_study::report::view;
use scindo_world::mesh_in::{Organ, SolidSurface};

use crate::lab::{ExperimentBench, Trouble};

type V = Vector3<f64>;

/// Finest cells along the longest side of a solid.
const CELLS: [u32; 4] = [16, 32, 64, 128];
/// The solids.
const ORGANS: [Organ; 3] = [Organ::Liver, Organ::Kidney, Organ::Brain];
/// Levels of coarsening.
const LEVELS: u8 = 2;
/// Cells of the pictures: few enough that a difference can be seen.
const SHOWN: u32 = 32;
/// Share of a surface that is nearer than the distance called *far*.
const NEARLY_ALL: f64 = 0.99;

/// The experiment.
///
/// # Errors
/// A solid without cells, or the user ended the study.
pub(super) fn skin(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "cells-skin",
        title: "The surface of cells beside the solid's own".into(),
        about: "Organs are filled with octree cells. Their surface, by dual contouring, is what is drawn, touched and \
            cut. It knows where links between cells leave the solid and the normals there, so its vertices lie near \
            the surface that the solid was made from. A body of cells has no skin of its own triangles, as \
            tetrahedra may have; this page shows what such a skin could change where nothing is cut: next to nothing on \
            a smooth organ, and folds narrower than a cell on the brain."
            .into(),
        ..ExperimentResult::default()
    };
    let mut table = Table::new(
        "Distances of the two surfaces",
        "In sides of a finest cell: the mean over the vertices of the cells' surface, and the distance that 99 % of \
         the vertices of either surface keep from the other, and the largest one. Normals are means over the \
         triangles around a vertex, as a display shades them: mean angle between both at the same place.",
        &[
            ("side of a cell [m]", Unit::Number),
            ("triangles", Unit::Count),
            ("own triangles", Unit::Count),
            ("mean", Unit::Number),
            ("far", Unit::Number),
            ("largest", Unit::Number),
            ("normals [°]", Unit::Number),
        ],
    );
    let cells = if bench.is_quick() { &CELLS[..2] } else { &CELLS[..] };
    for organ in ORGANS {
        let surface = organ.surface();
        let (solid, _) = SolidSurface::new(&surface, 1.0)?;
        let own = Triangles::new(surface.vertices, surface.triangles);
        for &across in cells {
            bench.begin(format!("{}, {across} across", organ.name()), ORGANS.len() * cells.len())?;
            let (of_cells, h) = filled(&solid, across)?;
            let apart = of_cells.apart(&own)?;
            // In sides of a cell, so that all sizes compare.
            table.row(
                format!("{}, {across} across", organ.name()),
                &[
                    h,
                    of_cells.triangles.len() as f64,
                    own.triangles.len() as f64,
                    apart.mean / h,
                    apart.far / h,
                    apart.largest / h,
                    apart.normals_deg,
                ]
                .map(Some),
            );
            // Numbers do not tell whether a fold has gone, so both surfaces are also shown.
            if across == SHOWN {
                for (surface, words) in [(&of_cells, "the surface of its cells"), (&own, "its own surface")] {
                    let caption = format!("{}, {across} cells across: {words}", organ.name());
                    result.pictures.push(view::triangles(
                        &surface.vertices,
                        &surface.triangles,
                        V::z(),
                        caption,
                    ));
                }
            }
        }
    }
    result.tables.push(table);
    Ok(result)
}

/// A surface.
pub(super) struct Triangles {
    vertices: Vec<V>,
    triangles: Vec<[u32; 3]>,
    /// Mean normals of the triangles around every vertex, by area.
    normals: Vec<V>,
}

/// The surface of the cells that fill a solid, and the side of a finest one [m].
///
/// # Errors
/// The solid has no cells of this size.
pub(super) fn filled(solid: &SolidSurface, cells: u32) -> Result<(Triangles, f64), Trouble> {
    let octree = Octree::fill(solid, OctreeSettings { cells, levels: LEVELS }, &|_| 0)?;
    let built = OctreeSurface::build(&octree);
    let x = octree.rest_positions();
    let surface = built.surface();
    let vertices = surface.vertices.iter().map(|v| v.position(&x)).collect();
    Ok((Triangles::new(vertices, surface.triangles.clone()), octree.lattice().h))
}

/// How far two surfaces are apart [m], and their normals [°].
pub(super) struct Apart {
    /// Over the vertices of the first.
    pub mean: f64,
    /// Of nearly all vertices of either.
    pub far: f64,
    /// Of all vertices of either.
    pub largest: f64,
    /// Mean angle between the normals.
    pub normals_deg: f64,
}

impl Triangles {
    fn new(vertices: Vec<V>, triangles: Vec<[u32; 3]>) -> Self {
        let mut normals = vec![V::zeros(); vertices.len()];
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|v| vertices[v as usize]);
            let area = (b - a).cross(&(c - a));
            triangle.iter().for_each(|&v| normals[v as usize] += area);
        }
        normals.iter_mut().for_each(|n| *n = n.try_normalize(0.0).unwrap_or_default());
        Self { vertices, triangles, normals }
    }

    /// The distances of this surface from `other`.
    ///
    /// # Errors
    /// A surface without triangles.
    pub(super) fn apart(&self, other: &Self) -> Result<Apart, Trouble> {
        let (there, angles) = self.distances(other)?;
        let (back, _) = other.distances(self)?;
        let mean = there.iter().sum::<f64>() / there.len() as f64;
        let quantile = |mut all: Vec<f64>, share: f64| {
            all.sort_by(f64::total_cmp);
            all[((all.len() - 1) as f64 * share) as usize]
        };
        let of_either = |share| quantile(there.clone(), share).max(quantile(back.clone(), share));
        Ok(Apart {
            mean,
            far: of_either(NEARLY_ALL),
            largest: of_either(1.0),
            normals_deg: angles.iter().sum::<f64>() / angles.len() as f64,
        })
    }

    /// Distance [m] of every vertex from `other`, and the angle [°] between the normals there.
    fn distances(&self, other: &Self) -> Result<(Vec<f64>, Vec<f64>), Trouble> {
        let single =
            |vertices: &[V]| vertices.iter().map(|v| v.cast::<f32>().into()).collect::<Vec<[f32; 3]>>();
        let tree = SurfaceBvh::new(&single(&other.vertices), &other.triangles)?;
        let mut used = vec![false; self.vertices.len()];
        self.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
        let (mut distances, mut angles) = (Vec::new(), Vec::new());
        for ((&vertex, normal), _) in
            self.vertices.iter().zip(&self.normals).zip(used).filter(|(_, used)| *used)
        {
            let near = tree.closest_point(vertex, f64::INFINITY).ok_or("a surface without triangles")?;
            let corners = other.triangles[near.triangle as usize];
            let mean: V =
                corners.iter().zip(near.barycentric).map(|(&v, w)| w * other.normals[v as usize]).sum();
            distances.push((near.point - vertex).norm());
            angles.push(mean.angle(normal).to_degrees());
        }
        Ok((distances, angles))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A square of 1 m whose edge x = 1 is raised by `slope`, at the height `z`.
    fn square(z: f64, slope: f64) -> Triangles {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let vertices = corners.map(|[x, y]| V::new(x, y, z + slope * x)).to_vec();
        Triangles::new(vertices, vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn distances_and_angles_are_those_of_two_planes() {
        let apart = square(0.0, 0.0).apart(&square(0.1, 0.0)).unwrap();
        assert!([apart.mean, apart.far, apart.largest].iter().all(|d| (d - 0.1).abs() < 1e-6));
        assert!(apart.normals_deg < 1e-3);
        let tilted = square(0.0, 0.0).apart(&square(0.0, 1.0)).unwrap();
        assert!((tilted.normals_deg - 45.0).abs() < 1e-3, "{}", tilted.normals_deg);
        // The far corners of the tilted square are 1 m above the level one; from there the slope is nearer.
        assert!((tilted.largest - 1.0).abs() < 1e-6 && tilted.mean < 0.4, "{}", tilted.mean);
    }

    #[test]
    fn the_cells_of_an_organ_lie_near_its_surface() {
        let surface = Organ::Kidney.surface();
        let (solid, _) = SolidSurface::new(&surface, 1.0).unwrap();
        let own = Triangles::new(surface.vertices, surface.triangles);
        let (of_cells, h) = filled(&solid, 24).unwrap();
        let apart = of_cells.apart(&own).unwrap();
        assert!(apart.mean < 0.04 * h && apart.far < 0.2 * h && apart.normals_deg < 3.0);
    }
}

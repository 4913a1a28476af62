//! Bodies, materials and blades that several cases share.

use nalgebra::Vector3;
use scindo_physics::body::Body;
use scindo_physics::cut::{BladeSweep, CutMesh, CutReport, Piece};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};

use crate::lab::Trouble;

/// A vector.
pub(super) type V = Vector3<f64>;

/// Edge of the cubes [m].
pub(super) const L: f64 = 0.1;

/// Gravity [m/s²].
pub(super) const DOWN: V = V::new(0.0, -9.81, 0.0);

/// A light, soft material without damping.
pub(super) const SOFT: Material = Material {
    young_pa: 1e5,
    poisson: 0.33,
    density_kg_m3: 100.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};

/// The same material with damping.
pub(super) fn damped(mass_1_s: f64, stiffness_s: f64) -> Material {
    Material { rayleigh: Rayleigh { mass_1_s, stiffness_s }, ..SOFT }
}

/// A cube of 0.1 m, six tetrahedra per cell.
pub(super) fn cube(cells: usize) -> TetMesh {
    block([L; 3], [cells; 3])
}

/// A block with its corner at the origin, six tetrahedra per cell.
pub(super) fn block(size: [f64; 3], cells: [usize; 3]) -> TetMesh {
    box_mesh(V::zeros(), size.into(), cells, BoxPattern::Tet6)
}

/// The pieces of a body of tetrahedra, each with the volume [m³] of its uncut element.
pub(super) fn pieces(body: &Body) -> impl Iterator<Item = (&Piece, f64)> {
    let tets = body.tets().into_iter();
    tets.flat_map(|tets| tets.pieces().iter().map(|p| (p, tets.mesh().volume(p.element as usize))))
}

/// Nodes whose rest position `chosen` accepts.
pub(super) fn nodes(rest: &[V], chosen: impl Fn(&V) -> bool) -> Vec<u32> {
    (0u32..).zip(rest).filter(|(_, X)| chosen(X)).map(|(n, _)| n).collect()
}

/// Clamps the nodes at x = 0.
pub(super) fn clamp_left(body: &mut Body) -> Result<Vec<u32>, Trouble> {
    let clamp = nodes(body.rest_positions(), |X| X.x == 0.0);
    body.fix(&clamp, [true; 3], V::zeros())?;
    Ok(clamp)
}

/// A blade that spans z and sweeps the plane x = `at` from y = `from` to `to`, all in edges of the cube.
pub(super) fn slice(at: f64, from: f64, to: f64) -> BladeSweep {
    let segment = |y: f64| [V::new(at, y, -5.0) * L, V::new(at, y, 5.0) * L];
    BladeSweep { segments: vec![segment(from), segment(to)] }
}

/// A square of half width `reach` [m] in the plane through `point` with `normal`.
pub(super) fn plane(point: V, normal: V, reach: f64) -> BladeSweep {
    let n = normal.normalize();
    let helper = if n.x.abs() < 0.6 { V::x() } else { V::y() };
    let u = n.cross(&helper).normalize() * reach;
    let w = n.cross(&u);
    BladeSweep { segments: vec![[point - u - w, point - u + w], [point + u - w, point + u + w]] }
}

/// A cut state with the positions of its copies.
#[derive(Clone, Debug)]
pub(super) struct Shaped {
    /// Pieces and copies.
    pub mesh: CutMesh,
    /// Position of every copy [m].
    pub x: Vec<V>,
}

impl Shaped {
    /// The mesh at rest.
    pub(super) fn new(mesh: CutMesh) -> Self {
        let x = mesh.rest_positions();
        Self { mesh, x }
    }

    /// Sweeps a blade. New copies start at the positions of the copies that they were split from.
    pub(super) fn sweep(&mut self, blade: &BladeSweep, incision: u32) -> Result<CutReport, Trouble> {
        let report = self.mesh.sweep(&self.x, blade, incision)?;
        for new in &report.new_copies {
            self.x.push(self.x[new.parent as usize]);
        }
        Ok(report)
    }

    /// Numbers of parts, pieces and copies.
    pub(super) fn topology(&self) -> [usize; 3] {
        [self.mesh.components().len(), self.mesh.pieces().len(), self.mesh.n_copies()]
    }

    /// Rest volumes of the parts [m³], ascending.
    pub(super) fn volumes(&self) -> Vec<f64> {
        let mut volumes = self.mesh.components().volume;
        volumes.sort_by(f64::total_cmp);
        volumes
    }
}

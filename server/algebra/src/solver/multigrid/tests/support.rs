//! Bodies, the operator in double precision, and solvers that measure.

use nalgebra::{Matrix3, Rotation3, Vector3};
use scindo_matter::cut::BladeSweep;
use scindo_matter::element::FixedCopy;
use scindo_matter::material::Lame;
use scindo_matter::octree::{BoxShape, CutLink, LinkKey, Octree, OctreeSettings, corner_weights};
use scindo_matter::team::Team;

use crate::operator::cells::unit_stiffness;
use crate::operator::{
    BlockJacobi, Inverse3, LinearOperator, Padded, Preconditioner, Spring, filter, invert, padded,
};
use crate::solver::multigrid::galerkin::Galerkin;
use crate::solver::multigrid::operator::CellProducts;
use crate::solver::multigrid::{CellMaterial, Coefficients, Cycle, Hierarchy, Multigrid, MultigridSettings};

pub(crate) type V3 = Vector3<f64>;

pub(crate) fn cube(cells: u32, levels: u8) -> Octree {
    let shape = BoxShape { min: V3::zeros(), max: V3::repeat(1.0) };
    Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap()
}

/// A number between −1 and 1.
pub(crate) fn noise(i: usize, seed: usize) -> f64 {
    let x = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add((seed as u64) << 17);
    let x = (x ^ x >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    ((x ^ x >> 32) & 0xFFFF_FFFF) as f64 / 2_147_483_648.0 - 1.0
}

pub(crate) fn vector(n: usize, seed: usize) -> Vec<V3> {
    (0..n).map(|i| V3::new(noise(3 * i, seed), noise(3 * i + 1, seed), noise(3 * i + 2, seed))).collect()
}

/// The cut of one link.
pub(crate) fn cut_at(at: [i32; 3], axis: u8) -> (LinkKey, CutLink) {
    let normal = V3::ith(usize::from(axis), 1.0);
    ((at, axis), CutLink { at: [0.5; 2], normal: [normal; 2], incision: 1 })
}

/// Planes across x and y between cells `planes` − 1 and `planes`, from the top down to half the height.
pub(crate) fn blade_grid(octree: &mut Octree, planes: &[i32]) {
    let n = octree.lattice().size.map(|n| n as i32);
    let mut cuts = Vec::new();
    for &i in planes {
        for j in 0..n[0] {
            for k in n[2] / 2..n[2] {
                cuts.push(cut_at([i - 1, j, k], 0));
                cuts.push(cut_at([j, i - 1, k], 1));
            }
        }
    }
    octree.cut(&cuts);
}

/// Cuts by `n` planes in either direction, turned by 30° about z, from the top down to half the height.
pub(crate) fn turned_blades(mut octree: Octree, n: u32) -> Octree {
    let at = octree.rest_positions();
    let (low, high) = at.iter().fold((at[0], at[0]), |(low, high), x| (low.inf(x), high.sup(x)));
    let (centre, side) = (0.5 * (low + high), high.x - low.x);
    let turn = Rotation3::from_axis_angle(&V3::z_axis(), 30_f64.to_radians());
    let mut blades = Vec::new();
    for (axis, i) in [0, 1].into_iter().flat_map(|axis| (0..n).map(move |i| (axis, i))) {
        let across = side * 1.1 * ((f64::from(i) + 0.5) / f64::from(n) - 0.5);
        let point = |along: f64, z: f64| {
            let flat = if axis == 0 { V3::new(across, along, z) } else { V3::new(along, across, z) };
            centre + turn * flat
        };
        let segment = |z: f64| [point(-side, z), point(side, z)];
        blades.push(BladeSweep { segments: vec![segment(0.6 * side), segment(0.0)] });
    }
    octree.cut_along(&mut Team::alone(), &at, &blades).unwrap();
    octree
}

/// The vertices with lattice coordinate 0 along `axis`, held in all directions.
pub(crate) fn clamped(octree: &Octree, axis: usize) -> Vec<FixedCopy> {
    let low = (0_u32..).zip(octree.points()).filter(|(_, p)| p[axis] == 0);
    low.map(|(copy, _)| FixedCopy { copy, held: [true; 3].into(), position_m: [0.0; 3] }).collect()
}

pub(crate) fn coefficients(poisson: f64, mass_factor: f64) -> Coefficients {
    let E = 1e6;
    let lame = Lame {
        mu: E / (2.0 * (1.0 + poisson)),
        lambda: E * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
    };
    Coefficients { materials: vec![CellMaterial { lame, density_kg_m3: 1000.0 }], scale: 1.0, mass_factor }
}

/// A of the finest level in double precision, cell by cell.
pub(crate) struct Exact {
    pub octree: Octree,
    pub rotations: Vec<Matrix3<f64>>,
    K: Vec<[[f64; 24]; 24]>,
    scale: f64,
    pub mass: Vec<f64>,
    pub fixed: Vec<FixedCopy>,
    pub springs: Vec<Spring>,
}

impl Exact {
    pub(crate) fn new(octree: &Octree, with: &Coefficients, fixed: &[FixedCopy]) -> Self {
        let n = octree.cells().len();
        let mut mass = vec![0.0; octree.n_vertices()];
        for id in 0..n {
            let material = with.materials[usize::from(octree.cells()[id].material)];
            let share = with.mass_factor * material.density_kg_m3 * octree.cell_volume(id) / 8.0;
            for row in corner_weights(&octree.cells()[id], octree.hanging()[id]) {
                for (&v, w) in octree.vertices()[id].iter().zip(row) {
                    mass[v as usize] += w * share;
                }
            }
        }
        Self {
            octree: octree.clone(),
            rotations: vec![Matrix3::identity(); n],
            K: with.materials.iter().map(|m| unit_stiffness(m.lame)).collect(),
            scale: with.scale,
            mass,
            fixed: fixed.to_vec(),
            springs: Vec::new(),
        }
    }

    /// Turns every cell about `axis` by an angle [rad] that depends on its place.
    pub(crate) fn turn(&mut self, angle: impl Fn(V3) -> V3) {
        let octree = &self.octree;
        let lattice = octree.lattice();
        for (R, cell) in self.rotations.iter_mut().zip(octree.cells()) {
            *R = Rotation3::new(angle(lattice.centre(cell.at))).into_inner();
        }
    }

    pub(crate) fn rotation(&self, id: u32) -> Matrix3<f32> {
        self.rotations[id as usize].map(|r| r as f32)
    }

    pub(crate) fn filter(&self, v: &mut [V3]) {
        for f in &self.fixed {
            f.held.clear(&mut v[f.copy as usize]);
        }
    }

    /// A x with prescribed directions filtered out.
    pub(crate) fn apply(&self, x: &[V3]) -> Vec<V3> {
        let mut x = x.to_vec();
        self.filter(&mut x);
        let mut y: Vec<V3> = x.iter().zip(&self.mass).map(|(x, m)| *m * x).collect();
        let h = self.octree.lattice().h;
        for (id, cell) in self.octree.cells().iter().enumerate() {
            let (vertices, hanging) = (self.octree.vertices()[id], self.octree.hanging()[id]);
            let R = self.rotations[id];
            let W = (hanging != 0).then(|| corner_weights(cell, hanging));
            let mut u = vertices.map(|v| x[v as usize]);
            if let Some(W) = &W {
                u = W.map(|row| row.iter().zip(&u).map(|(w, u)| *w * u).sum());
            }
            let u = u.map(|u| R.transpose() * u);
            let u = u.as_flattened_24();
            let K = &self.K[usize::from(cell.material)];
            let s = self.scale * h * f64::from(cell.side());
            let f: [V3; 8] = std::array::from_fn(|c| {
                let row = |i: usize| K[3 * c + i].iter().zip(&u).map(|(k, u)| k * u).sum::<f64>();
                s * (R * V3::new(row(0), row(1), row(2)))
            });
            for c in 0..8 {
                match &W {
                    None => y[vertices[c] as usize] += f[c],
                    Some(W) => (0..8).for_each(|v| y[vertices[v] as usize] += W[c][v] * f[c]),
                }
            }
        }
        for spring in &self.springs {
            let moved: V3 = spring.point.carriers().map(|(c, w)| f64::from(w) * x[c]).sum();
            let k = f64::from(spring.stiffness);
            let n = spring.direction.map(|n| V3::new(n[0].into(), n[1].into(), n[2].into()));
            let f = n.map_or(k * moved, |n| k * n.dot(&moved) * n);
            spring.point.carriers().for_each(|(c, w)| y[c] += f64::from(w) * f);
        }
        self.filter(&mut y);
        y
    }
}

trait Flat {
    fn as_flattened_24(&self) -> [f64; 24];
}

impl Flat for [V3; 8] {
    fn as_flattened_24(&self) -> [f64; 24] {
        std::array::from_fn(|i| self[i / 3][i % 3])
    }
}

/// A of the finest level in single precision.
pub(crate) struct Fine {
    hierarchy: Hierarchy,
    galerkin: Galerkin,
    products: CellProducts,
    fixed: Vec<FixedCopy>,
    pub springs: Vec<Spring>,
    pub jacobi: BlockJacobi,
}

impl Fine {
    pub(crate) fn new(team: &mut Team, exact: &Exact, with: &Coefficients) -> Self {
        let mut hierarchy = Hierarchy::with(&exact.octree, usize::MAX, true);
        hierarchy.list_finest_slots();
        let mut galerkin = Galerkin::new(&hierarchy);
        galerkin.update(team, &hierarchy, (with, &exact.fixed), &|id| exact.rotation(id), 0.0);
        let mut jacobi = BlockJacobi::default();
        jacobi.resize(hierarchy.n_vertices());
        let operator = galerkin.operator(&hierarchy.levels[0], 0);
        operator.invert_diagonal(team, |v| galerkin.fixed(v as u32), jacobi.inverses_mut());
        let products = vec![[[0.0; 4]; 8]; exact.octree.cells().len()];
        Self { hierarchy, galerkin, products, fixed: exact.fixed.clone(), springs: Vec::new(), jacobi }
    }

    pub(crate) fn fixed(&self) -> &[FixedCopy] {
        &self.fixed
    }

    pub(crate) fn inverses(&mut self) -> Vec<Inverse3> {
        self.jacobi.inverses_mut().to_vec()
    }
}

impl LinearOperator for Fine {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        let Self { hierarchy, galerkin, products, fixed, springs, .. } = self;
        galerkin.operator(&hierarchy.levels[0], 0).apply(team, x, y, products);
        for spring in springs {
            spring.add_to(x, y);
        }
        filter(fixed, y);
    }
}

/// A body with everything that solves it.
pub(crate) struct Scene {
    pub team: Team,
    pub exact: Exact,
    pub with: Coefficients,
    pub fine: Fine,
    pub inverse: Vec<Inverse3>,
    pub largest: f64,
    pub multigrid: Multigrid,
}

impl Scene {
    pub(crate) fn new(
        octree: &Octree,
        with: Coefficients,
        fixed: &[FixedCopy],
        settings: MultigridSettings,
    ) -> Self {
        Self::of(Exact::new(octree, &with, fixed), with, Hierarchy::with(octree, 600, true), settings)
    }

    pub(crate) fn of(
        exact: Exact,
        with: Coefficients,
        hierarchy: Hierarchy,
        settings: MultigridSettings,
    ) -> Self {
        let mut team = Team::new(1).unwrap();
        let mut fine = Fine::new(&mut team, &exact, &with);
        let inverse = fine.inverses();
        let multigrid = Multigrid::new(hierarchy, settings);
        let mut scene = Self { team, exact, with, fine, inverse, largest: 0.0, multigrid };
        scene.update();
        scene
    }

    pub(crate) fn update(&mut self) {
        let Self { team, exact, with, fine, inverse, multigrid, .. } = self;
        multigrid.update(team, (with, &exact.fixed), &|id| exact.rotation(id));
        multigrid.estimate_eigenvalues(team, fine, inverse);
    }

    /// Prolongs trilinearly in thin cells, too.
    pub(crate) fn lock(&mut self) {
        self.multigrid.galerkin = Galerkin::new(self.multigrid.hierarchy());
        self.multigrid.galerkin.trilinear = true;
        self.update();
    }

    /// Adds springs to the finest level; `largest` is the bound of its largest eigenvalue then.
    pub(crate) fn add_springs(&mut self, springs: &[Spring], largest: f64) {
        let mut diagonal = vec![[0.0; 8]; self.exact.mass.len()];
        let operator = self.fine.galerkin.operator(&self.fine.hierarchy.levels[0], 0);
        diagonal.iter_mut().enumerate().for_each(|(v, block)| *block = operator.diagonal(v));
        for spring in springs {
            spring.point.carriers().for_each(|(c, w)| spring.add_to_block(w, &mut diagonal[c]));
        }
        for (c, _) in springs.iter().flat_map(|spring| spring.point.carriers()) {
            self.inverse[c] = invert(&diagonal[c], [false; 3]);
        }
        self.exact.springs = springs.to_vec();
        self.fine.springs = springs.to_vec();
        self.largest = largest;
    }

    /// Adds springs to the finest level that all levels take.
    pub(crate) fn add_stiff_springs(&mut self, springs: &[Spring]) {
        self.exact.springs = springs.to_vec();
        self.fine.springs = springs.to_vec();
        let inverse = &self.inverse;
        self.largest = self.multigrid.set_springs(springs, |v| inverse[v as usize]).unwrap();
    }

    /// V r, scaled into the range of single precision.
    pub(crate) fn cycle(&mut self, r: &[V3]) -> Vec<V3> {
        let scale = 1.0 / r.iter().map(|r| r.amax()).fold(f64::MIN_POSITIVE, f64::max);
        let r: Vec<Padded> = r.iter().map(|r| padded(&(scale * r))).collect();
        let mut z = vec![[0.0; 4]; r.len()];
        let mut partial = vec![0.0; r.len().div_ceil(crate::operator::BLOCK)];
        let Self { team, fine, inverse, largest, multigrid, .. } = self;
        let mut M = Cycle { multigrid, inverse, largest: *largest };
        M.apply(team, fine, &r, &mut z, &mut partial);
        z.iter().map(|z| V3::new(z[0].into(), z[1].into(), z[2].into()) / scale).collect()
    }

    /// Iterations of conjugate gradients in double precision, preconditioned by the cycle, until the true
    /// residual of A x = b has fallen by `tolerance`, from x = 0; and x.
    pub(crate) fn mg_pcg(&mut self, b: &[V3], tolerance: f64) -> (u32, Vec<V3>) {
        let mut x = vec![V3::zeros(); b.len()];
        let mut r = b.to_vec();
        self.exact.filter(&mut r);
        let start = dot(&r, &r).sqrt();
        let mut z = self.cycle(&r);
        let (mut p, mut rz) = (z.clone(), dot(&r, &z));
        for iteration in 1..=200 {
            let q = self.exact.apply(&p);
            let alpha = rz / dot(&p, &q);
            for i in 0..x.len() {
                x[i] += alpha * p[i];
                r[i] -= alpha * q[i];
            }
            if dot(&r, &r).sqrt() <= tolerance * start {
                return (iteration, x);
            }
            z = self.cycle(&r);
            let next = dot(&r, &z);
            let beta = next / rz;
            rz = next;
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + beta * *p);
        }
        (u32::MAX, x)
    }

    /// Factor by which a cycle reduces the error in the norm of A, late in the iteration.
    pub(crate) fn rate(&mut self) -> f64 {
        let mut e = vector(self.exact.mass.len(), 5);
        self.exact.filter(&mut e);
        let mut norms = Vec::new();
        for _ in 0..16 {
            let r = self.exact.apply(&e);
            norms.push(dot(&e, &r).sqrt());
            let z = self.cycle(&r);
            e.iter_mut().zip(z).for_each(|(e, z)| *e -= z);
        }
        (norms[15] / norms[11]).powf(0.25)
    }

    /// Loads of gravity along −z [N].
    pub(crate) fn gravity(&self) -> Vec<V3> {
        let volumes = self.exact.octree.vertex_volumes();
        volumes.iter().map(|v| V3::new(0.0, 0.0, -9810.0 * v)).collect()
    }
}

pub(crate) fn dot(a: &[V3], b: &[V3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

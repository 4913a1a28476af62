//! The operators of the levels: A^{ℓ+1} = Pᵀ A^ℓ P, cell by cell.
//!
//! A coarse cell deforms its children trilinearly, so its matrix is the sum of theirs in the corners of the coarse
//! cell. Eight whole children of one material and nearly one rotation give the matrix of a cube of twice the side,
//! which all such cells share, unless the cell is [thin](super::thin). Every other matrix is stored, in the frame of the cell's mean rotation: a rotation
//! of everything changes nothing that is stored.
//!
//! # Source
//! Dick, Georgii, Westermann 2011, §6.1 and eq. 2.

use nalgebra::{Matrix3, Rotation3};
use scindo_matter::element::Simd;
use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::material::Lame;
use scindo_matter::octree::corner_shares;
use scindo_matter::team::{Team, blocks};

use super::carried::Carried;
use super::dense::{Dense, Rows};
use super::hierarchy::Hierarchy;
use super::level::NONE;
use super::matrices::{
    CellMatrix, INCLINED, LevelMatrices, Rotation, SAME, Stored, Within, cell_matrix, shared_matrix,
};
use super::refresh::Context;
use super::table;
use super::thin::is_thin;
use crate::operator::BLOCK;
use crate::operator::cells::unit_stiffness;

/// Stored cells per unit of work.
const STORED_BLOCK: usize = 8;

/// Constants of the material of cells.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CellMaterial {
    /// Lamé parameters [Pa].
    pub lame: Lame,
    /// Density [kg/m³].
    pub density_kg_m3: f64,
}

/// The constants of A = `mass_factor` M + `scale` K̂.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Coefficients {
    /// By number of the material; cells of further numbers have those of number 0, the body.
    pub materials: Vec<CellMaterial>,
    /// Factor of K̂.
    pub scale: f64,
    /// Factor of the lumped mass.
    pub mass_factor: f64,
}

impl Coefficients {
    /// Whether the lumped masses times their factor are those of `other`.
    fn has_mass_of(&self, other: &Self) -> bool {
        let [own, others] =
            [self, other].map(|of| of.materials.iter().map(|material| material.density_kg_m3));
        self.mass_factor == other.mass_factor && own.eq(others)
    }
}

/// What an update of the operators changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Updated {
    /// The constants; all matrices are new then.
    pub constants: bool,
    /// Some matrix, in the frame of its cell.
    pub matrices: bool,
    /// Directions are free that were prescribed.
    pub released: bool,
}

/// The matrices of all levels.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Galerkin {
    pub levels: Vec<LevelMatrices>,
    /// Matrix of every kind of cell; for leaves without mass.
    pub shared: Vec<Dense>,
    /// The same, row by row.
    pub(super) rows: Vec<Rows>,
    /// The same in the corners of a parent.
    pub(super) carried: Carried,
    /// Mass [kg] times its factor of an eighth of a leaf of every kind.
    pub(super) eighth: Vec<f32>,
    /// Prescribed directions of every vertex of the finest level: one bit each, or [`INCLINED`] and more.
    pub(super) fixed: Vec<u8>,
    /// The directions that are not world axes, each once; number [`INCLINED`] stands for the first of them.
    inclined: Vec<Held>,
    pub(super) coefficients: Option<Coefficients>,
    pub(super) known_fixed: Vec<(u32, Held)>,
    /// The level that is solved on, and its prescribed directions if it is not the finest one.
    pub(super) first: usize,
    pub(super) held: Vec<(u32, Held)>,
    pub(super) held_bits: Vec<u8>,
    /// Whether thin cells move trilinearly, too; for comparison.
    #[cfg(test)]
    pub(super) trilinear: bool,
}

impl Galerkin {
    /// Room for the matrices of `hierarchy`.
    pub(super) fn new(hierarchy: &Hierarchy) -> Self {
        let levels = hierarchy.levels.iter().enumerate().map(|(l, level)| {
            let n = level.cells.len();
            let kinds = &hierarchy.kind_of[l];
            LevelMatrices {
                frame: vec![Rotation::identity(); n],
                // A cell without a kind is stored by the first update.
                matrix: kinds.iter().map(|&kind| CellMatrix::Shared(kind)).collect(),
                mass: vec![0.0; if level.has_slots() { level.n_vertices } else { 0 }],
                holds: vec![[false; 2]; n],
                changed: vec![false; n],
                ..LevelMatrices::default()
            }
        });
        Self { levels: levels.collect(), fixed: vec![0; hierarchy.n_vertices()], ..Self::default() }
    }

    /// Brings all matrices up to date. `rotation` gives that of a leaf of the octree; merged cells count as cubes
    /// if the rotations of their children differ by at most `tolerance` [rad] from the mean, and stored ones are
    /// computed again when these turned by more than that relative to each other.
    pub(super) fn update(
        &mut self,
        team: &mut Team,
        hierarchy: &Hierarchy,
        (with, fixed): (&Coefficients, &[FixedCopy]),
        rotation: &(dyn Fn(u32) -> Matrix3<f32> + Sync),
        tolerance: f64,
    ) -> Updated {
        let anew = self.coefficients.as_ref() != Some(with);
        let mut released = false;
        if anew {
            let same_fixed = fixed.iter().map(|f| (f.copy, f.held)).eq(self.known_fixed.iter().copied());
            let same_mass =
                same_fixed && self.coefficients.as_ref().is_some_and(|known| known.has_mass_of(with));
            self.known_fixed.clear();
            self.known_fixed.extend(fixed.iter().map(|f| (f.copy, f.held)));
            self.mark_held(hierarchy);
            self.set_coefficients(hierarchy, with);
            if !same_mass {
                self.sum_masses(hierarchy);
            }
        } else if !self.is_made_for(with, fixed) {
            released = self.hold(hierarchy, fixed);
        }
        let tolerance = (tolerance as f32).max(SAME);
        let exact = tolerance == SAME;
        let within = Within::new(tolerance);
        let finest = &mut self.levels[0];
        finest.changed.fill(anew);
        finest.mark_touched();
        team.for_blocks(blocks(&mut finest.frame, BLOCK), |block, frames| {
            for (i, frame) in frames.iter_mut().enumerate() {
                let R = rotation((block * BLOCK + i) as u32);
                *frame = Rotation::from_rotation_matrix(&Rotation3::from_matrix_unchecked(R));
            }
        });
        let mut any = anew;
        for l in 1..self.levels.len() {
            any |= self.update_level(team, hierarchy, l, (within, exact, anew));
        }
        Updated { constants: anew, matrices: any, released }
    }

    /// The constants of the last update.
    pub(super) fn coefficients(&self) -> Option<&Coefficients> {
        self.coefficients.as_ref()
    }

    /// Whether the last update had these constants and prescribed directions.
    pub(super) fn is_made_for(&self, with: &Coefficients, fixed: &[FixedCopy]) -> bool {
        self.coefficients.as_ref() == Some(with)
            && fixed.iter().map(|f| (f.copy, f.held)).eq(self.known_fixed.iter().copied())
    }

    /// Notes which cells have prescribed vertices below them.
    fn mark_held(&mut self, hierarchy: &Hierarchy) {
        self.fixed.fill(0);
        self.inclined.clear();
        self.enter_fixed(hierarchy);
        for (holds, vertices) in self.levels[0].holds.iter_mut().zip(&hierarchy.levels[0].vertices) {
            *holds = held(&self.fixed, vertices);
        }
        for l in 1..self.levels.len() {
            let (below, level) = self.levels.split_at_mut(l);
            let (below, level) = (&below[l - 1].holds, &mut level[0].holds);
            level.fill([false; 2]);
            for (child, &parent) in hierarchy.steps[l - 1].parent.iter().enumerate() {
                (0..2).for_each(|k| level[parent as usize][k] |= below[child][k]);
            }
        }
    }

    /// Enters the prescribed directions in the bits of vertices, where those of all others are 0.
    pub(super) fn enter_fixed(&mut self, hierarchy: &Hierarchy) {
        for &(copy, held) in &self.known_fixed {
            if let Some(fixed) = self.fixed.get_mut(copy as usize) {
                *fixed = code(&mut self.inclined, held);
            }
        }
        self.hold_coarse(hierarchy);
    }

    /// Computes shared matrices.
    fn set_coefficients(&mut self, hierarchy: &Hierarchy, with: &Coefficients) {
        self.shared.clear();
        self.rows.clear();
        self.eighth.clear();
        self.add_kinds(hierarchy, with);
        let (shared, eighth) = (&self.shared, &self.eighth);
        self.carried.update(hierarchy, |l, id| {
            let kind = hierarchy.kind_of[l][id] as usize;
            shared_matrix(&hierarchy.levels[l], id, &shared[kind], eighth[kind])
        });
        match &mut self.coefficients {
            Some(known) => known.clone_from(with),
            None => self.coefficients = Some(with.clone()),
        }
    }

    /// Sums the lumped masses of leaves at the vertices.
    fn sum_masses(&mut self, hierarchy: &Hierarchy) {
        for (l, level) in hierarchy.levels.iter().enumerate().filter(|(_, level)| level.has_slots()) {
            let mass = &mut self.levels[l].mass;
            mass.fill(0.0);
            for id in (0..level.cells.len()).filter(|&id| level.leaf[id]) {
                if l > 0 && self.levels[l].holds[id][0] {
                    continue;
                }
                let share = self.eighth[hierarchy.kind_of[l][id] as usize];
                let mass = &mut self.levels[l].mass;
                let corners = corner_shares(&level.cells[id], level.hanging[id]);
                for (&v, corners) in level.vertices[id].iter().zip(corners) {
                    mass[v as usize] += corners as f32 * share;
                }
            }
        }
    }

    /// Computes shared matrices of the kinds that have none yet.
    pub(super) fn add_kinds(&mut self, hierarchy: &Hierarchy, with: &Coefficients) {
        let of = |number: u16| with.materials.get(usize::from(number)).or(with.materials.first());
        for kind in &hierarchy.kinds[self.shared.len()..] {
            let none = CellMaterial { lame: Lame { mu: 0.0, lambda: 0.0 }, density_kg_m3: 0.0 };
            let material = of(kind.material).unwrap_or(&none);
            let side = f64::from(1_u32 << kind.side) * hierarchy.h;
            let mass = with.mass_factor * material.density_kg_m3 * side.powi(3);
            let K = unit_stiffness(material.lame);
            let M = (kind.merged > 0).then(|| table::merged_mass(kind.merged));
            let cube = table::cube(&K, with.scale * side, M.as_ref(), mass);
            self.rows.push(cube.rows());
            self.shared.push(cube);
            self.eighth.push((mass / 8.0) as f32);
        }
    }

    fn update_level(
        &mut self,
        team: &mut Team,
        hierarchy: &Hierarchy,
        l: usize,
        (within, exact, anew): (Within, bool, bool),
    ) -> bool {
        let (below, level) = self.levels.split_at_mut(l);
        let (fine, level) = (&below[l - 1], &mut level[0]);
        let step = &hierarchy.steps[l - 1];
        // Coarser levels that are solved on keep trilinear cells.
        let cells = &hierarchy.levels[l];
        let may_be_thin = l > self.first;
        #[cfg(test)]
        let may_be_thin = may_be_thin && !self.trilinear;
        let (kinds, exactness) = (&hierarchy.kind_of[l], &hierarchy.exact[l]);
        let LevelMatrices { frame, matrix, stored, free, holds, changed, touched, .. } = level;
        // Frames, and which cells are cubes.
        let cubes = (blocks(frame, BLOCK), blocks(changed, BLOCK));
        team.for_blocks(cubes, |block, (frames, cubes)| {
            for (i, (frame, cube)) in frames.iter_mut().zip(cubes).enumerate() {
                let id = block * BLOCK + i;
                let children = step.children_of(id);
                let [holds_any, holds_partly] = holds[id];
                *frame = if holds_partly { Rotation::identity() } else { mean(children, &fine.frame) };
                let near = |&c: &u32| {
                    let c = c as usize;
                    matches!(fine.matrix[c], CellMatrix::Shared(_)) && within.holds(frame, &fine.frame[c])
                };
                let is_kind = kinds[id] != NONE && (exactness[id] || !exact);
                let whole = !holds_any && is_kind && children.iter().all(near);
                *cube = whole && !(may_be_thin && is_thin(cells, id));
            }
        });
        // Places for stored matrices. They are large, so all new ones get their room at once.
        let needed =
            matrix.iter().zip(&*changed).filter(|(m, cube)| matches!(m, CellMatrix::Shared(_)) && !**cube);
        let more = needed.count().saturating_sub(free.len());
        if stored.len() + more > stored.capacity() {
            // Where more come while the body bends, many more may follow.
            let spare = if stored.is_empty() { 8 } else { 2 };
            stored.reserve_exact(more + (stored.len() + more) / spare);
        }
        for id in 0..matrix.len() {
            // Up to here `changed` held which cells are cubes; from now on it means what its name says.
            let cube = changed[id];
            changed[id] = anew;
            match (matrix[id], cube) {
                (CellMatrix::Stored(place), true) => {
                    stored[place as usize].cell = NONE;
                    stored[place as usize].inner.clear();
                    free.push(place);
                    matrix[id] = CellMatrix::Shared(kinds[id]);
                    changed[id] = true;
                }
                (CellMatrix::Shared(_), false) => {
                    let place = free.pop().unwrap_or(stored.len() as u32);
                    if place as usize == stored.len() {
                        stored.push(Stored::empty());
                    }
                    let new = &mut stored[place as usize];
                    (new.cell, new.stale) = (id as u32, true);
                    new.relative.clear();
                    new.relative.resize(step.children_of(id).len(), Rotation::identity());
                    matrix[id] = CellMatrix::Stored(place);
                }
                _ => {}
            }
        }
        // A cut or other prescribed directions came upon these cells, whatever became of their matrices above.
        let mut any = !touched.is_empty();
        touched.drain(..).for_each(|id| changed[id as usize] = true);
        // Prescribed directions enter once, above the level on which they are given; higher levels inherit them.
        let held = match l {
            1 => &self.fixed[..],
            _ if l == self.first + 1 => &self.held_bits[..],
            _ => &[],
        };
        let (shared, carried) = (&self.shared, &self.carried);
        let context = Context {
            hierarchy,
            l,
            fine,
            shared,
            carried,
            held,
            inclined: &self.inclined,
            eighth: &self.eighth,
            may_be_thin,
        };
        let frame = &*frame;
        let simd = Simd::detect();
        team.for_blocks(blocks(stored, STORED_BLOCK), |_, stored| {
            context.refresh(simd, stored, frame, (within, anew));
        });
        // The level above reads `changed`, so stale matrices are booked before its turn.
        for stored in stored.iter_mut().filter(|stored| stored.cell != NONE) {
            changed[stored.cell as usize] |= stored.stale;
            any |= stored.stale;
            stored.stale = false;
        }
        self.levels[l].list_thin();
        any
    }

    /// Bytes in use: all but stored matrices, and these.
    pub(super) fn memory(&self) -> [usize; 2] {
        let of = |level: &LevelMatrices| {
            let own = |s: &Stored| size_of_val(&s.relative[..]) + s.inner.memory();
            let relative: usize = level.stored.iter().map(own).sum();
            let relative = relative + size_of_val(&level.passed[..]);
            let others = size_of_val(&level.frame[..])
                + size_of_val(&level.matrix[..])
                + size_of_val(&level.mass[..])
                + size_of_val(&level.holds[..])
                + size_of_val(&level.changed[..])
                + size_of_val(&level.free[..]);
            [others, size_of_val(&level.stored[..]) + relative]
        };
        let levels = self.levels.iter().map(of);
        let [others, stored] = levels.fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
        [others + size_of_val(&self.fixed[..]), stored]
    }

    /// The matrix of cell `id` of level `l` over the vertices that carry it, in its frame, with all of its mass.
    pub(super) fn cell_matrix(&self, hierarchy: &Hierarchy, l: usize, id: usize) -> Dense {
        cell_matrix(hierarchy, (l, id), &self.levels[l], &self.shared, &self.eighth)
    }

    /// Vertices with prescribed directions, and which directions these are, on the level that is solved on.
    pub(super) fn held(&self) -> &[(u32, Held)] {
        if self.first == 0 { &self.known_fixed } else { &self.held }
    }

    /// Prescribed directions of vertex `v` of the finest level, one bit each.
    #[cfg(test)]
    pub(super) fn fixed(&self, v: u32) -> u8 {
        self.fixed[v as usize]
    }
}

/// The number that stands for `held`, which is added to `inclined` if it is new there.
///
/// Where a body is held in more different directions than numbers are left, coarse levels leave further vertices to
/// the smoother: they count as held there in all directions.
fn code(inclined: &mut Vec<Held>, held: Held) -> u8 {
    if let Some(axes) = held.axes() {
        return (0..3).fold(0, |bits, k| bits | u8::from(axes[k]) << k);
    }
    let at = inclined.iter().position(|known| *known == held).unwrap_or_else(|| {
        inclined.push(held);
        inclined.len() - 1
    });
    match u8::try_from(at + usize::from(INCLINED)) {
        Ok(code) => code,
        Err(_) => {
            inclined.truncate(usize::from(u8::MAX - INCLINED) + 1);
            7
        }
    }
}

/// Whether directions of any of these vertices are prescribed, and whether some of a vertex are and others not.
pub(super) fn held(fixed: &[u8], vertices: &[u32; 8]) -> [bool; 2] {
    let fixed = vertices.map(|v| fixed[v as usize]);
    [fixed.iter().any(|&f| f != 0), fixed.iter().any(|&f| f != 0 && f != 7)]
}

/// The mean of rotations that are near each other.
fn mean(children: &[u32], frames: &[Rotation]) -> Rotation {
    let first = frames[children[0] as usize];
    if children.len() == 1 {
        return first;
    }
    let sum = children.iter().fold(nalgebra::Quaternion::new(0.0, 0.0, 0.0, 0.0), |sum, &c| {
        let q = frames[c as usize];
        if q.coords.dot(&first.coords) < 0.0 { sum - q.into_inner() } else { sum + q.into_inner() }
    });
    Rotation::try_new(sum, 1e-6).unwrap_or(first)
}

//! s K̂ of an octree.

use std::borrow::Cow;

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::Simd;
use scindo_matter::material::Lame;
use scindo_matter::octree::{Cell, Lattice, OUTSIDE, Octree};
use scindo_matter::team::{Team, blocks, ranges};

use super::super::stiffness::{Direction, ElasticUpdate, Place, Stiffness, Tension, UpdateAt, apply};
use super::super::tet_batch::Block6;
use super::super::twist::TwistCoefficients;
use super::super::{LinearOperator, OperatorChoice, Padded};
use super::chunk::CellChunk;
use super::lane::{CellLane, CellMatrix};
use super::operator::{CellOperator, morton_order};
use super::sectors::SectorTable;
use super::update::{CellTables, RestChunk};

/// s K̂ of the cells of an octree, its internal forces and diagonal blocks. The law is linear or corotational with
/// one rotation per cell.
///
/// K̂ is always applied matrix-free; the [choice](OperatorChoice) of an assembled one is ignored.
///
/// # Source
/// Dick, Georgii, Westermann 2011, §5; Georgii, Westermann 2008 (the rotation that minimises the distance of
/// the whole cell; for a cube it is that of the deformation gradient at the centre).
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct CellStiffness {
    operator: CellOperator,
    rest: Vec<RestChunk>,
    cells: Vec<Cell>,
    lattice: Lattice,
    materials: Materials,
    /// Least density [kg/m³] of the regions, if there are any.
    lightest: Option<f64>,
    /// Parameters of the last update.
    made_with: Option<ElasticUpdate>,
    /// Whether a cut arranged cells anew since then.
    cut: bool,
    version: u64,
}

impl CellStiffness {
    /// Arranges the cells of `octree` for the kernels, all rotations at rest. A cell of material n has the
    /// parameters `materials[n − 1]`; those of other cells come with every [update](Stiffness::update).
    pub fn new(simd: Simd, octree: &Octree, materials: &[Lame]) -> Self {
        let materials = Materials::new(materials);
        let (operator, rest) = arrange(simd, octree, &materials);
        let (cells, lattice) = (octree.cells().to_vec(), *octree.lattice());
        let lightest = octree.regions().iter().map(|region| region.density_kg_m3).reduce(f64::min);
        Self { operator, rest, cells, lattice, materials, lightest, made_with: None, cut: false, version: 0 }
    }

    /// Bytes in use.
    pub fn memory(&self) -> usize {
        let [operator, stored] = self.operator.memory();
        let rest: usize = self.rest.iter().map(RestChunk::memory).sum();
        operator + stored + rest + size_of_val(&self.cells[..])
    }

    /// Follows a cut, a refinement or a coarsening of the octree. Cells keep their rotations; new ones have that of
    /// the leaf they were part of, and joined ones that of their first part.
    pub fn follow(&mut self, octree: &Octree) {
        let known = |id: u32| self.operator.rotation(self.operator.places()[id as usize]);
        let rotations: Vec<Matrix3<f32>> = self
            .sources(octree)
            .into_iter()
            .map(|source| if source == OUTSIDE { Matrix3::identity() } else { known(source) })
            .collect();
        let (operator, rest) = arrange(self.operator.simd, octree, &self.materials);
        (self.operator, self.rest, self.made_with) = (operator, rest, None);
        self.cells.clear();
        self.cells.extend_from_slice(octree.cells());
        for chunk in &mut self.operator.chunks {
            chunk.set_rotations(&|id| rotations[id as usize]);
        }
    }

    /// The same after a cut that changed the cells in `changed`, ascending, and left the numbers of all others.
    /// Only the chunks of these cells are arranged anew.
    pub fn follow_cut(&mut self, octree: &Octree, changed: &[u32]) {
        let cells = octree.cells();
        let Self { operator, rest, cells: known, materials, made_with, .. } = self;
        let lane = |id: u32| {
            let matrix = CellMatrix::Table(materials.table_of(cells[id as usize].material));
            CellLane { factor: 1.0, ..CellLane::of_leaf(octree, id as usize, matrix) }
        };
        let source = |id: u32| octree.whole_of(known, id);
        // Rotations of all cells in the chunks that change.
        let mut kept = Kept { number: vec![NONE; cells.len()], rotations: Vec::with_capacity(changed.len()) };
        for &id in changed {
            let old = if (id as usize) < known.len() { id } else { source(id) };
            let chunk = &operator.chunks[operator.places()[old as usize].chunk as usize];
            let first = chunk.places().next();
            if first.is_some_and(|(cell, ..)| kept.number[cell as usize] == NONE) {
                for (cell, batch, lane) in chunk.places() {
                    kept.add(cell, chunk.rotation(batch, lane));
                }
            }
        }
        for &id in changed.iter().filter(|&&id| id as usize >= known.len()) {
            kept.add(id, kept.get(source(id)));
        }
        let renewed = operator.follow(changed, [cells.len(), octree.n_vertices()], &lane, &source);
        let h = octree.lattice().h;
        let side = |id: u32| f64::from(cells[id as usize].side()) * h;
        for chunk in renewed {
            let arranged = &mut operator.chunks[chunk];
            arranged.set_rotations(&|id| kept.get(id));
            let arranged = RestChunk::new(arranged, octree.points(), side);
            if chunk < rest.len() {
                rest[chunk] = arranged
            } else {
                rest.push(arranged)
            }
            if let Some(with) = made_with {
                let factor = |id: u32| materials.factor(&cells[id as usize], h, with);
                operator.chunks[chunk].set_factors(&factor);
            }
        }
        for &id in changed {
            match known.get_mut(id as usize) {
                Some(cell) => *cell = cells[id as usize],
                None => known.push(cells[id as usize]),
            }
        }
        self.cut = true;
    }

    /// For every cell the earlier one that it was part of, or whose place it begins at.
    ///
    /// Cells keep their order when others vanish, and new ones come last. A cell that was divided or joined has the
    /// low corner and the number of its first part.
    fn sources(&self, octree: &Octree) -> Vec<u32> {
        let mut sources: Vec<u32> = Vec::with_capacity(octree.cells().len());
        let mut next = 0;
        for cell in octree.cells() {
            let same = self.cells[next..].iter().position(|known| known.at == cell.at);
            // Once a cell is new, all that follow are.
            let source = match same {
                Some(skipped) => {
                    next += skipped + 1;
                    next as u32 - 1
                }
                None => {
                    next = self.cells.len();
                    let first = (cell.level + 1..=octree.lattice().levels).find_map(|level| {
                        let at = cell.at.map(|c| c >> level << level);
                        let &source = sources.get(octree.leaf(at) as usize)?;
                        let known = self.cells.get(source as usize)?;
                        (known.level == level && known.at == at).then_some(source)
                    });
                    first.unwrap_or(OUTSIDE)
                }
            };
            sources.push(source);
        }
        sources
    }

    /// The cells as an operator.
    pub fn operator(&self) -> &CellOperator {
        &self.operator
    }

    /// Factors and tables for the parameters of an update.
    fn set(&mut self, team: &mut Team, with: &ElasticUpdate) {
        self.operator.set_tables(&self.materials.tables(with.lame));
        let (cells, h, materials) = (&self.cells, self.lattice.h, &self.materials);
        self.operator.set_factors(team, |id| materials.factor(&cells[id as usize], h, with));
        if !with.law.rotates() {
            self.operator.set_rotations(team, |_| Matrix3::identity());
        }
    }
}

impl CellStiffness {
    /// Constants of twists for every table. Where regions differ in density, the least one counts.
    fn set_twists(&mut self, with: &ElasticUpdate, tension: Option<&Tension<'_>>) {
        let ratios = self.materials.ratios.iter().copied().chain([with.lame.lambda / with.lame.mu]);
        for (table, lambda) in self.operator.tables.iter_mut().zip(ratios) {
            table.twists = tension.map(|tension| {
                let density = self.lightest.map_or(tension.density_kg_m3, |d| d.min(tension.density_kg_m3));
                let s = tension.s / with.scale;
                TwistCoefficients::new(Lame { mu: 1.0, lambda }, density, s, 1.0)
            });
        }
    }
}

const NONE: u32 = u32::MAX;

/// Rotations of some cells.
struct Kept {
    /// Entry of `rotations` by cell, or [`NONE`].
    number: Vec<u32>,
    rotations: Vec<Matrix3<f32>>,
}

impl Kept {
    fn add(&mut self, cell: u32, R: Matrix3<f32>) {
        self.number[cell as usize] = self.rotations.len() as u32;
        self.rotations.push(R);
    }

    /// I for a cell that is not known.
    fn get(&self, cell: u32) -> Matrix3<f32> {
        let number = self.number[cell as usize] as usize;
        self.rotations.get(number).copied().unwrap_or_else(Matrix3::identity)
    }
}

fn arrange(simd: Simd, octree: &Octree, materials: &Materials) -> (CellOperator, Vec<RestChunk>) {
    let cells = octree.cells();
    let lanes: Vec<CellLane> = (0..cells.len())
        .map(|id| {
            let matrix = CellMatrix::Table(materials.table_of(cells[id].material));
            CellLane { factor: 1.0, ..CellLane::of_leaf(octree, id, matrix) }
        })
        .collect();
    // Those of other materials come with the first update.
    let tables = materials.tables(Lame { mu: 1.0, lambda: 0.0 });
    let operator = CellOperator::new(simd, &tables, &lanes, &morton_order(cells), octree.n_vertices());
    let h = octree.lattice().h;
    let side = |id: u32| f64::from(cells[id as usize].side()) * h;
    let rest = operator.chunks.iter().map(|chunk| RestChunk::new(chunk, octree.points(), side)).collect();
    (operator, rest)
}

impl Stiffness for CellStiffness {
    fn update(
        &mut self,
        team: &mut Team,
        with: &ElasticUpdate,
        positions: &[Vector3<f64>],
        tension: Option<&Tension<'_>>,
    ) -> usize {
        let rotates = with.law.rotates();
        let same = self.made_with.is_some_and(|made| {
            (made.lame, made.scale, made.law.rotates()) == (with.lame, with.scale, rotates)
        });
        if !same {
            self.set(team, with);
            self.made_with = Some(*with);
        }
        let same = same && !std::mem::take(&mut self.cut);
        self.version += u64::from(rotates || !same);
        self.set_twists(with, tension.filter(|_| rotates));
        let CellOperator { simd, tables, chunks, gather, sums, diagonals, .. } = &mut self.operator;
        let (simd, with) = (*simd, CellTables { tables, scale: with.scale as f32 });
        let rows = (ranges(sums, &gather.first_row), ranges(&mut *diagonals, &gather.first_row));
        let (rest, lattice) = (&self.rest, &self.lattice);
        team.for_blocks((blocks(&mut *chunks, 1), rows), |k, (chunk, (f, diagonal))| {
            let (chunk, rest): (&mut CellChunk, &RestChunk) = (&mut chunk[0], &rest[k]);
            if rotates {
                rest.update(simd, chunk, with, UpdateAt { positions, tension }, f);
            } else {
                chunk.inverted = 0;
                rest.linear_forces(simd, chunk, with, (positions, lattice), f);
            }
            if rotates || !same {
                chunk.diagonals(simd, with.tables, diagonal);
            }
        });
        // All chunks take part where one does, as in those of tetrahedra.
        if let (Some(tension), true) = (tension, chunks.iter().any(|chunk| chunk.twisted)) {
            let rows = ranges(diagonals, &gather.first_row);
            team.for_blocks((blocks(&mut *chunks, 1), rows), |k, (chunk, diagonal)| {
                if !chunk[0].twisted {
                    rest[k].find_twists(simd, &mut chunk[0], with.tables, tension.at, true);
                    chunk[0].diagonals(simd, with.tables, diagonal);
                }
            });
        }
        chunks.iter().map(|chunk| chunk.inverted).sum()
    }

    #[inline(always)]
    fn forces(&self, block: usize, f: &mut [Padded]) {
        f.fill([0.0; 4]);
        self.operator.add_products(block, f);
    }

    #[inline(always)]
    fn diagonals(&self, block: usize, diagonal: &mut [Block6]) {
        diagonal.fill([0.0; 8]);
        self.operator.add_diagonals(block, diagonal);
    }

    fn version(&self) -> u64 {
        self.version
    }

    fn multiply(&mut self, team: &mut Team, x: &[Padded]) {
        self.operator.multiply(team, x);
    }

    fn multiply_damping(&mut self, team: &mut Team, x: &[Padded]) {
        self.operator.multiply_chunks(team, x, false);
    }

    fn multiply_direction(&mut self, team: &mut Team, z: &[Padded], beta: f32) {
        self.operator.multiply_direction(team, z, beta);
    }

    #[inline(always)]
    fn add_products(&self, block: usize, y: &mut [Padded]) {
        self.operator.add_products(block, y);
    }

    #[inline(always)]
    fn advance(&self, block: usize, with: &Direction<'_>, p: &mut [Padded], q: &mut [Padded]) -> f64 {
        self.operator.advance(block, with, p, q)
    }

    /// Nothing: there is only [`OperatorChoice::MatrixFree`].
    fn set_choice(&mut self, _: OperatorChoice) {}

    fn is_twisted(&self) -> bool {
        self.operator.chunks.iter().any(|chunk| chunk.twisted)
    }

    fn choice(&self) -> OperatorChoice {
        OperatorChoice::MatrixFree
    }

    fn places(&self) -> Cow<'_, [Place]> {
        Cow::Borrowed(self.operator.places())
    }

    #[inline(always)]
    fn rotation(&self, place: Place) -> Matrix3<f32> {
        self.operator.rotation(place)
    }
}

impl LinearOperator for CellStiffness {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        apply(self, team, x, y);
    }

    fn start(&mut self, team: &mut Team, x: &[Padded]) -> bool {
        self.operator.multiply(team, x);
        true
    }

    fn finish(&self, block: usize, _: &[Padded], y: &mut [Padded]) {
        y.fill([0.0; 4]);
        self.operator.add_products(block, y);
    }
}

/// Parameters by number of region, from 1; region 0 has those of the body. Regions with the same λ/μ have one
/// table.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct Materials {
    lame: Vec<Lame>,
    /// Table of each of them.
    table: Vec<u16>,
    /// λ/μ of every table but the last, which is that of all other numbers.
    ratios: Vec<f64>,
}

impl Materials {
    fn new(lame: &[Lame]) -> Self {
        let mut materials = Self { lame: lame.to_vec(), table: Vec::new(), ratios: Vec::new() };
        for lame in lame {
            let ratio = lame.lambda / lame.mu;
            let at = materials.ratios.iter().position(|r| *r == ratio).unwrap_or_else(|| {
                materials.ratios.push(ratio);
                materials.ratios.len() - 1
            });
            materials.table.push(at as u16);
        }
        materials
    }

    fn table_of(&self, material: u16) -> u16 {
        let region = usize::from(material).checked_sub(1).and_then(|r| self.table.get(r));
        region.copied().unwrap_or(self.ratios.len() as u16)
    }

    /// Factor of the table of a cell, with finest cells of side `h` [m].
    fn factor(&self, cell: &Cell, h: f64, with: &ElasticUpdate) -> f32 {
        (self.lame(cell.material, with.lame).mu * f64::from(cell.side()) * h * with.scale) as f32
    }

    fn lame(&self, material: u16, other: Lame) -> Lame {
        usize::from(material).checked_sub(1).and_then(|r| self.lame.get(r)).copied().unwrap_or(other)
    }

    /// Tables of cubes of side 1 m with μ = 1 Pa.
    fn tables(&self, other: Lame) -> Vec<SectorTable> {
        let ratios = self.ratios.iter().copied().chain([other.lambda / other.mu]);
        ratios.map(|lambda| SectorTable::elastic(Lame { mu: 1.0, lambda })).collect()
    }
}

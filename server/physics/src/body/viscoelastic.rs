//! How the strains of the springs of a viscoelastic body follow a change of its elements.
//!
//! A piece that a cut divides hands its strains on to all its parts, and a cell that is divided those of each octant to
//! the cell there. Where several become one, which undoing a cut and coarsening do, it takes their mean by volume. So does
//! a piece of a quadratic element whose quadrature points a cut has moved.

use std::collections::BTreeMap;

use scindo_algebra::assembly::Model;
use scindo_matter::material::Strain;
use scindo_matter::octree::{At, Cell};

use super::Body;
use crate::space::Space;

/// The elements of a viscoelastic body before a change, and the strains of its springs.
#[derive(Debug)]
pub(super) struct Outline {
    strains: Vec<Strain>,
    /// Weight [m³] of every quadrature point.
    weights: Vec<f64>,
    elements: Elements,
    n_copies: usize,
}

#[derive(Debug)]
enum Elements {
    /// Tetrahedron and copies of every piece.
    Pieces(Vec<PieceKey>),
    Cells(Vec<Cell>),
    /// Elements that nothing changes.
    Fixed,
}

type PieceKey = (u32, [u32; 4]);

impl Elements {
    fn of(space: &dyn Space) -> Self {
        match (space.octree(), space.tets().filter(|_| space.can_be_cut())) {
            (Some(octree), _) => Self::Cells(octree.octree().cells().to_vec()),
            (None, Some(tets)) => {
                Self::Pieces(tets.pieces().iter().map(|piece| (piece.element, piece.copies)).collect())
            }
            (None, None) => Self::Fixed,
        }
    }
}

/// The copy among the first `n` that `copy` was split from.
fn root(split_from: &[u32], n: usize, mut copy: u32) -> u32 {
    while copy as usize >= n {
        copy = split_from[copy as usize];
    }
    copy
}

impl Outline {
    /// Numbers the copies as they were when there were `n` of them.
    pub(super) fn rooted(mut self, split_from: &[u32], n: usize) -> Self {
        if let Elements::Pieces(pieces) = &mut self.elements {
            let all = pieces.iter_mut().flat_map(|(_, copies)| copies);
            all.for_each(|copy| *copy = root(split_from, n, *copy));
        }
        Self { n_copies: n, ..self }
    }

    /// Strains of all points of element `e`, with `terms` for each point.
    fn of(&self, e: usize, per_element: usize) -> &[Strain] {
        &self.strains[e * per_element..][..per_element]
    }
}

/// Strains of an element by terms: sums with weights.
struct Mean {
    sum: Vec<Strain>,
    weight: f64,
}

impl Mean {
    fn new(terms: usize) -> Self {
        Self { sum: vec![[0.0; 6]; terms], weight: 0.0 }
    }

    /// Adds quadrature points with these weights and strains.
    fn add(&mut self, weights: &[f64], strains: &[Strain]) {
        let terms = self.sum.len();
        for (w, strains) in weights.iter().zip(strains.chunks_exact(terms)) {
            self.weight += w;
            for (sum, strain) in self.sum.iter_mut().zip(strains) {
                sum.iter_mut().zip(strain).for_each(|(sum, strain)| *sum += w * strain);
            }
        }
    }

    /// Writes the mean to every point of `strains`.
    fn write(&self, strains: &mut [Strain]) {
        if self.weight > 0.0 {
            for point in strains.chunks_exact_mut(self.sum.len()) {
                for (strain, sum) in point.iter_mut().zip(&self.sum) {
                    *strain = sum.map(|s| s / self.weight);
                }
            }
        }
    }
}

impl Body {
    /// The elements of a viscoelastic body as they are now; `None` for other bodies.
    pub(super) fn outline(&self) -> Option<Outline> {
        let model = self.dynamics.model().filter(|_| !self.settings.prony.is_empty())?;
        Some(Outline {
            strains: self.state.viscous.clone(),
            weights: (0..model.n_elements()).flat_map(|e| model.weights(e)).copied().collect(),
            elements: Elements::of(&*self.space),
            n_copies: self.space.n_copies(),
        })
    }

    /// Takes the strains of the springs over from the elements before a change.
    pub(super) fn carry_viscous(&mut self, before: Option<Outline>) {
        let (Some(before), Some(model)) = (before, self.dynamics.model()) else { return };
        let terms = self.settings.prony.len();
        let mut strains = vec![[0.0; 6]; model.n_strains()];
        match (&before.elements, Elements::of(&*self.space)) {
            (Elements::Pieces(known), Elements::Pieces(mut now)) => {
                for copy in now.iter_mut().flat_map(|(_, copies)| copies) {
                    *copy = root(&self.split_from, before.n_copies, *copy);
                }
                carry_pieces((&before, known), (model, &now), terms, &mut strains);
            }
            (Elements::Cells(known), Elements::Cells(now)) => {
                let per_cell = strains.len() / now.len().max(1);
                carry_cells((&before, known), &now, (per_cell, terms), &mut strains);
            }
            _ if strains.len() == before.strains.len() => strains.copy_from_slice(&before.strains),
            _ => {}
        }
        self.state.viscous = strains;
        self.dynamics.follow_viscous(&mut self.team, &self.state);
    }
}

fn carry_pieces(
    (before, known): (&Outline, &[PieceKey]),
    (model, now): (&Model, &[PieceKey]),
    terms: usize,
    all: &mut [Strain],
) {
    let Some(points) = (model.n_elements() > 0).then(|| model.weights(0).len()) else { return };
    let of_key = |(e, key): (usize, &PieceKey)| (*key, e);
    let mut by_key: BTreeMap<PieceKey, Vec<usize>> = BTreeMap::new();
    for (key, e) in known.iter().enumerate().map(of_key) {
        by_key.entry(key).or_default().push(e);
    }
    for (e, (key, strains)) in now.iter().zip(all.chunks_exact_mut(points * terms)).enumerate() {
        let (tet, _) = *key;
        let same = by_key.get(key).map(Vec::as_slice).unwrap_or_default();
        let all = by_key.range((tet, [0; 4])..=(tet, [u32::MAX; 4])).flat_map(|(_, pieces)| pieces);
        let from: Vec<usize> = if same.is_empty() { all.copied().collect() } else { same.to_vec() };
        let weights_of = |from: usize| &before.weights[from * points..][..points];
        match from[..] {
            [one] if weights_of(one) == model.weights(e) => {
                strains.copy_from_slice(before.of(one, points * terms));
            }
            _ => {
                let mut mean = Mean::new(terms);
                from.iter().for_each(|&from| mean.add(weights_of(from), before.of(from, points * terms)));
                mean.write(strains);
            }
        }
    }
}

/// The octant of `cell` that contains the smaller cell at `at`: bit k is its end along axis k.
fn octant(cell: &Cell, at: At) -> usize {
    (0..3).map(|k| usize::from(2 * (at[k] - cell.at[k]) >= cell.side()) << k).sum()
}

fn ancestor(at: At, level: u8) -> (At, u8) {
    (at.map(|c| c >> level << level), level)
}

/// Of `per_element` strains of a cell, point q has `terms`; it lies in octant q.
fn carry_cells(
    (before, known): (&Outline, &[Cell]),
    now: &[Cell],
    (per_element, terms): (usize, usize),
    all: &mut [Strain],
) {
    if per_element == 0 {
        return;
    }
    let points = per_element / terms;
    let coarsest = known.iter().chain(now).map(|cell| cell.level).max().unwrap_or_default();
    let places = |cells: &[Cell]| -> BTreeMap<(At, u8), usize> {
        (0..).zip(cells).map(|(e, cell)| ((cell.at, cell.level), e)).collect()
    };
    let (were, mut joined) = (places(known), BTreeMap::new());
    for (e, (cell, strains)) in now.iter().zip(all.chunks_exact_mut(per_element)).enumerate() {
        let around = (cell.level..=coarsest).find_map(|level| were.get(&ancestor(cell.at, level)));
        match around {
            Some(&from) if known[from].level == cell.level => {
                strains.copy_from_slice(before.of(from, per_element));
            }
            Some(&from) => {
                let q = octant(&known[from], cell.at);
                let there = &before.of(from, per_element)[q * terms..][..terms];
                strains.chunks_exact_mut(terms).for_each(|point| point.copy_from_slice(there));
            }
            None => {
                joined.insert((cell.at, cell.level), (e, [(); 8].map(|()| Mean::new(terms))));
            }
        }
    }
    if joined.is_empty() {
        return;
    }
    for (from, cell) in known.iter().enumerate() {
        let levels = cell.level + 1..=coarsest;
        let Some(into) = levels.map(|level| ancestor(cell.at, level)).find(|at| joined.contains_key(at))
        else {
            continue;
        };
        if let Some((e, means)) = joined.get_mut(&into) {
            let q = octant(&now[*e], cell.at);
            let weights = &before.weights[from * points..][..points];
            means[q].add(weights, before.of(from, per_element));
        }
    }
    for (e, means) in joined.values() {
        let strains = &mut all[e * per_element..][..per_element];
        for (mean, point) in means.iter().zip(strains.chunks_exact_mut(terms)) {
            mean.write(point);
        }
    }
}

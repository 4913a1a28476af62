//! Levels that follow random sequences of cuts are those made from scratch, up to numbers of coarse cells and
//! vertices.

use std::collections::BTreeSet;

use scindo_matter::octree::{LinkKey, Octree};
use scindo_matter::team::Team;

use super::support::{Exact, Fine, V3, clamped, coefficients, cube, cut_at, noise, vector};
use crate::operator::{Inverse3, Padded, padded};
use crate::solver::multigrid::level::NONE;
use crate::solver::multigrid::matrices::CellMatrix;
use crate::solver::multigrid::{Hierarchy, Multigrid, MultigridSettings};

/// Cells of coarse levels, by level: `pairs[l][id]` is the number in the second hierarchy.
pub(super) struct Pairs {
    pub cells: Vec<Vec<u32>>,
    pub vertices: Vec<Vec<u32>>,
}

/// Finds which cells and vertices of two hierarchies of one octree are the same, and compares everything else.
pub(super) fn matched(followed: &Hierarchy, new: &Hierarchy) -> Pairs {
    let n = followed.n_levels();
    assert_eq!(n, new.n_levels());
    let mut pairs = Pairs { cells: Vec::new(), vertices: Vec::new() };
    for l in 0..n {
        let (a, b) = (&followed.levels[l], &new.levels[l]);
        assert_eq!((a.cells.len(), a.n_vertices), (b.cells.len(), b.n_vertices), "level {l}");
        let mut cells = vec![NONE; a.cells.len()];
        if l == 0 {
            cells = (0..a.cells.len() as u32).collect();
        } else {
            let below: &Vec<u32> = &pairs.cells[l - 1];
            for (child, &parent) in followed.steps[l - 1].parent.iter().enumerate() {
                let other = new.steps[l - 1].parent[below[child] as usize];
                let known = &mut cells[parent as usize];
                assert!(*known == NONE || *known == other, "level {l}: cell {parent} is {known} and {other}");
                *known = other;
            }
        }
        assert_eq!(cells.iter().collect::<BTreeSet<_>>().len(), cells.len(), "level {l}");
        let mut vertices = vec![NONE; a.n_vertices];
        for (id, &other) in cells.iter().enumerate() {
            let (x, y) = (id, other as usize);
            assert_eq!((a.cells[x], a.hanging[x]), (b.cells[y], b.hanging[y]), "level {l}, cell {id}");
            assert_eq!(a.leaf[x], b.leaf[y]);
            for c in 0..8 {
                let (v, w) = (a.vertices[x][c], b.vertices[y][c]);
                let known = &mut vertices[v as usize];
                assert!(*known == NONE || *known == w, "level {l}: vertex {v} is {known} and {w}");
                *known = w;
            }
            let kind = |h: &Hierarchy, id: usize| h.kinds.get(h.kind_of[l][id] as usize).copied();
            assert_eq!(kind(followed, x), kind(new, y), "level {l}, cell {id}");
            assert_eq!(followed.exact[l][x], new.exact[l][y]);
            if l > 0 {
                let children: BTreeSet<u32> = followed.steps[l - 1]
                    .children_of(x)
                    .iter()
                    .map(|&child| pairs.cells[l - 1][child as usize])
                    .collect();
                assert!(children.iter().eq(new.steps[l - 1].children_of(y)), "level {l}, cell {id}");
                let links = |list: &[u32], of: &dyn Fn(u32) -> u32| -> BTreeSet<u32> {
                    list.iter().map(|link| 8 * of(link / 8) + link % 8).collect()
                };
                let mapped = links(a.links.get(x), &|id| cells[id as usize]);
                assert_eq!(mapped, links(b.links.get(y), &|id| id), "level {l}, cell {id}");
            }
        }
        assert_eq!(vertices.iter().collect::<BTreeSet<_>>().len(), vertices.len(), "level {l}");
        assert!(!vertices.contains(&NONE), "level {l}: a vertex carries nothing");
        if l == 0 {
            assert!((0..).zip(&vertices).all(|(v, w)| v == *w));
        }
        for (v, &w) in vertices.iter().enumerate() {
            let slot = |(id, c): (usize, usize)| (cells[id] as usize, c);
            if a.has_slots() || b.has_slots() {
                let slots: BTreeSet<_> = a.slots_of(v).map(slot).collect();
                assert!(slots.into_iter().eq(b.slots_of(w as usize)), "level {l}, vertex {v}");
                assert!(a.slots.get(v).is_sorted());
            }
        }
        pairs.cells.push(cells);
        pairs.vertices.push(vertices);
    }
    for l in 0..n - 1 {
        let (a, b) = (&followed.steps[l].transfer, &new.steps[l].transfer);
        let (fine, coarse) = (&pairs.vertices[l], &pairs.vertices[l + 1]);
        let sorted = |mut list: Vec<(u32, f32)>| {
            list.sort_unstable_by_key(|entry| entry.0);
            list
        };
        for (v, &w) in fine.iter().enumerate() {
            let own = a.row(v).map(|(j, w)| (coarse[j as usize], w)).collect();
            assert_eq!(sorted(own), sorted(b.row(w as usize).collect()), "level {l}, row {v}");
        }
        for (v, &w) in coarse.iter().enumerate() {
            let own = a.column(v).map(|(i, w)| (fine[i as usize], w)).collect();
            assert_eq!(sorted(own), sorted(b.column(w as usize).collect()), "level {l}, column {v}");
        }
    }
    pairs
}

/// Random links of a body, some of them along planes, so that parts come apart.
pub(super) fn random_links(octree: &Octree, round: usize, seed: usize) -> Vec<LinkKey> {
    let n = octree.lattice().size.map(|n| n as i32);
    let pick = |k: usize, n: i32| ((noise(k, seed + 100 * round) + 1.0) / 2.0 * f64::from(n)) as i32;
    let axis = pick(0, 3) as usize;
    let plane = pick(1, n[axis] - 1);
    let (low, size) = ([pick(2, n[0]), pick(3, n[1]), pick(4, n[2])], pick(5, 6) + 1);
    let mut links = Vec::new();
    for i in 0..size {
        for j in 0..size {
            let mut at = low;
            at[axis] = plane;
            at[(axis + 1) % 3] = (low[(axis + 1) % 3] + i) % n[(axis + 1) % 3];
            at[(axis + 2) % 3] = (low[(axis + 2) % 3] + j) % n[(axis + 2) % 3];
            links.push((at, axis as u8));
        }
    }
    links.push(([pick(6, n[0] - 1), pick(7, n[1]), pick(8, n[2])], 0));
    links
}

pub(super) fn cut_links(octree: &mut Octree, links: &[LinkKey]) -> Vec<u32> {
    let cuts: Vec<_> = links.iter().map(|&(at, axis)| cut_at(at, axis)).collect();
    octree.cut(&cuts).cells
}

#[test]
fn levels_that_follow_cuts_are_those_made_anew() {
    let mut team = Team::new(2).unwrap();
    for (seed, (cells, levels)) in [(8, 0), (13, 2), (16, 3), (16, 0), (24, 2)].into_iter().enumerate() {
        let mut octree = cube(cells, levels);
        // Gauss–Seidel sweeps need the slots of the finest level, too.
        let made_of = |octree: &Octree| {
            let mut hierarchy = Hierarchy::with(octree, 100, true);
            if seed % 2 == 0 {
                hierarchy.list_finest_slots();
            }
            hierarchy
        };
        let mut followed = made_of(&octree);
        let rounds = if cells == 8 { 60 } else { 25 };
        let mut made_anew = 0;
        for round in 0..rounds {
            let links = random_links(&octree, round, seed);
            let changed = cut_links(&mut octree, &links);
            let new = made_of(&octree);
            match followed.follow(&octree, &changed) {
                Some(changes) => {
                    assert_eq!(changes[0].cells, changed);
                    followed.follow_transfers(&mut team, &changes, &mut |_| {});
                }
                None => {
                    made_anew += 1;
                    followed = new.clone();
                }
            }
            matched(&followed, &new);
        }
        assert!(made_anew <= 2, "{made_anew} of {rounds}");
    }
}

/// Largest difference of two lists over the largest entry of the second.
fn apart<const N: usize>(a: impl Iterator<Item = [f32; N]>, b: impl Iterator<Item = [f32; N]>) -> f32 {
    let (mut most, mut size) = (0.0_f32, f32::MIN_POSITIVE);
    for (a, b) in a.zip(b) {
        (0..N).for_each(|k| (most, size) = (most.max((a[k] - b[k]).abs()), size.max(b[k].abs())));
    }
    most / size
}

/// Compares all operators and a cycle of two multigrids of one octree.
fn compare(team: &mut Team, followed: &mut Multigrid, new: &mut Multigrid, fine: &mut Fine, name: &str) {
    let pairs = matched(&followed.hierarchy, &new.hierarchy);
    for l in 0..pairs.cells.len() {
        let (cells, vertices) = (&pairs.cells[l], &pairs.vertices[l]);
        for (id, &other) in cells.iter().enumerate() {
            let (a, b) =
                (followed.galerkin.levels[l].matrix[id], new.galerkin.levels[l].matrix[other as usize]);
            let stored = |m: CellMatrix| matches!(m, CellMatrix::Stored(_));
            assert_eq!(stored(a), stored(b), "{name}, level {l}, cell {id}");
            let a = followed.galerkin.cell_matrix(&followed.hierarchy, l, id);
            let b = new.galerkin.cell_matrix(&new.hierarchy, l, other as usize);
            let [a, b] =
                [a, b].map(|matrix| matrix.wide().into_iter().map(|row| row.map(|entry| entry as f32)));
            assert!(apart(a, b) < 1e-5, "{name}, level {l}, cell {id}");
        }
        assert_eq!(followed.galerkin.levels[l].mass.len(), new.galerkin.levels[l].mass.len());
        if !new.galerkin.levels[l].mass.is_empty() {
            let mass = |m: &Multigrid, v: usize| [m.galerkin.levels[l].mass[v]];
            let own = (0..vertices.len()).map(|v| mass(followed, v));
            assert!(apart(own, vertices.iter().map(|&w| mass(new, w as usize))) < 1e-5, "{name}, level {l}");
        }
        if l == 0 {
            continue;
        }
        let x: Vec<Padded> = vector(vertices.len(), l).iter().map(padded).collect();
        let mut mapped = x.clone();
        vertices.iter().zip(&x).for_each(|(&w, x)| mapped[w as usize] = *x);
        let mut y = [x.clone(), x.clone()];
        for ((m, x), y) in [(&mut *followed, &x), (&mut *new, &mapped)].into_iter().zip(&mut y) {
            let mass = &m.galerkin.levels[l].mass;
            m.levels[l].kernel.as_mut().unwrap().apply(team, mass, x, y);
        }
        let of_new = vertices.iter().map(|&w| y[1][w as usize]);
        assert!(apart(y[0].iter().copied(), of_new) < 1e-5, "{name}, products of level {l}");
        let flat = |inverse: &Inverse3| {
            let [a, b] = inverse.0;
            [a[0], a[1], a[2], b[0], b[1], b[2]]
        };
        let own = followed.levels[l].inverse.iter().map(flat);
        let of_new = vertices.iter().map(|&w| flat(&new.levels[l].inverse[w as usize]));
        assert!(apart(own, of_new) < 1e-4, "{name}, diagonal of level {l}");
    }
    // The same bounds, so that the cycles differ by nothing else.
    let inverse = fine.inverses();
    new.estimate_eigenvalues(team, fine, &inverse);
    for (a, b) in followed.levels.iter_mut().zip(&new.levels) {
        a.largest = b.largest;
    }
    let n = followed.n_vertices();
    let mut r: Vec<Padded> = vector(n, 9).iter().map(padded).collect();
    crate::operator::filter(fine.fixed(), &mut r);
    let mut z = [r.clone(), r.clone()];
    followed.cycle(team, fine, (&inverse, 0.0), &r, &mut z[0]);
    new.cycle(team, fine, (&inverse, 0.0), &r, &mut z[1]);
    let difference = apart(z[0].iter().copied(), z[1].iter().copied());
    assert!(difference < 2e-4, "{name}: cycles differ by {difference:e}");
}

/// After cuts near prescribed vertices, too, whose copies are prescribed then; and when some are released.
#[test]
fn operators_that_follow_cuts_are_those_made_anew() {
    let with = coefficients(0.3, 1e3);
    for (seed, (cells, levels)) in [(12, 0), (16, 3)].into_iter().enumerate() {
        for threads in [1, 2] {
            let mut team = Team::new(threads).unwrap();
            let mut octree = cube(cells, levels);
            // With a tolerance matrices would depend on earlier rotations, so these stay the same then.
            let (same_rotation_rad, turn) = if threads == 1 { (0.1, 0.0) } else { (0.0, 0.1) };
            let half_precision = false;
            let settings =
                MultigridSettings { same_rotation_rad, half_precision, ..MultigridSettings::default() };
            let made_anew = |octree: &Octree| {
                let mut hierarchy = Hierarchy::with(octree, 300, true);
                if threads == 2 {
                    hierarchy.list_finest_slots();
                }
                Multigrid::new(hierarchy, settings)
            };
            let mut followed = made_anew(&octree);
            for round in 0..12 {
                let mut fixed = clamped(&octree, 0);
                if round % 4 == 3 {
                    fixed.retain(|f| f.copy % 3 != 0);
                }
                let mut exact = Exact::new(&octree, &with, &fixed);
                exact.turn(|p| 0.8 * V3::new(p.y * p.x, (p.z + turn * f64::from(round)).sin(), -p.x));
                let rotation = |id: u32| exact.rotation(id);
                let mut new = made_anew(&octree);
                for multigrid in [&mut followed, &mut new] {
                    multigrid.update(&mut team, (&with, &fixed), &rotation);
                }
                let mut fine = Fine::new(&mut team, &exact, &with);
                let name = format!("{cells} cells, round {round}");
                compare(&mut team, &mut followed, &mut new, &mut fine, &name);
                // Two cuts between updates.
                for part in 0..2 {
                    let links = random_links(&octree, 2 * round as usize + part, seed);
                    let changed = cut_links(&mut octree, &links);
                    if !followed.follow(&mut team, (&octree, &changed), &mut || {}) {
                        followed = made_anew(&octree);
                    }
                }
            }
        }
    }
}

/// After many cuts no eigenvalue is larger than the smoother takes for the largest, on any level.
#[test]
fn eigenvalues_after_cuts_are_below_the_bounds() {
    let mut team = Team::new(1).unwrap();
    for poisson in [0.0, 0.3, 0.45] {
        let with = coefficients(poisson, 1e3);
        let mut octree = cube(16, 2);
        let mut followed = Multigrid::new(Hierarchy::with(&octree, 300, true), MultigridSettings::default());
        let mut rose = 0;
        for round in 0..16 {
            let exact = Exact::new(&octree, &with, &[]);
            let mut fine = Fine::new(&mut team, &exact, &with);
            let inverse = fine.inverses();
            followed.update(&mut team, (&with, &[]), &|id| exact.rotation(id));
            let before: Vec<f64> = followed.levels.iter().map(|level| level.largest).collect();
            followed.estimate_eigenvalues(&mut team, &mut fine, &inverse);
            let given: Vec<f64> = followed.levels.iter().map(|level| level.largest).collect();
            rose += usize::from(round > 0 && before.iter().zip(&given).any(|(a, b)| b > a));
            for (l, given) in given.iter().enumerate() {
                let largest = followed.true_eigenvalue(&mut team, &mut fine, &inverse, l);
                assert!(largest <= *given, "{poisson}, round {round}, level {l}: {largest} above {given}");
                assert!(
                    *given < 2.0 * largest,
                    "{poisson}, round {round}, level {l}: {largest} below {given}"
                );
            }
            let links = random_links(&octree, round, 7);
            let changed = cut_links(&mut octree, &links);
            assert!(followed.follow(&mut team, (&octree, &changed), &mut || {}));
        }
        assert!(rose > 0);
    }
}

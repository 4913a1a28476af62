//! Division of the elements into groups that are near each other and of one material.
//!
//! Every chunk of the stiffness holds pieces of one group, so its kernels work with one pair of Lamé constants.

use nalgebra::Vector3;
use scindo_matter::material::{Lame, Law, Region, Regions};

use super::law_coefficients::LawCoefficients;
use super::stiffness::{ElasticUpdate, Tension};
use super::tet_batch::Coefficients;
use super::twist::TwistCoefficients;

/// Elements per group: local vectors, gradients and indices of a chunk stay near the core, and a
/// body of a few thousand pieces still has work for several threads.
const GROUP_ELEMENTS: usize = 1024;
/// The group of every element, and the material of every group. Cuts do not change them: a piece is in a chunk of its
/// element's group.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Groups {
    of_element: Vec<u32>,
    /// Region of every group; 0 is the body's own material.
    regions: Vec<u16>,
    /// Constants of the regions 1, 2, ….
    constants: Vec<Region>,
}

impl Groups {
    /// Divides the elements of each material by recursive bisection of their rest centroids `centres`.
    pub(super) fn new(centres: &[Vector3<f64>], regions: &Regions) -> Self {
        let constants = regions.constants().to_vec();
        let mut groups = Self { of_element: vec![0; centres.len()], regions: Vec::new(), constants };
        for region in 0..=groups.constants.len() as u16 {
            let inside = |e: &u32| regions.of(*e as usize) == region;
            let mut order: Vec<u32> = (0..centres.len() as u32).filter(inside).collect();
            let parts = order.len().div_ceil(GROUP_ELEMENTS);
            bisect(&mut order, parts, centres, &mut |group| {
                let number = groups.regions.len() as u32;
                group.iter().for_each(|&e| groups.of_element[e as usize] = number);
                groups.regions.push(region);
            });
        }
        groups
    }

    /// Number of groups.
    pub(super) fn len(&self) -> usize {
        self.regions.len()
    }

    /// Group of element `e`.
    #[inline]
    pub(super) fn of(&self, e: u32) -> usize {
        self.of_element[e as usize] as usize
    }

    /// Coefficients of a group in an update whose constants are those of the body.
    pub(super) fn coefficients(
        &self,
        group: usize,
        with: &ElasticUpdate,
        tension: Option<&Tension<'_>>,
    ) -> Coefficients {
        let region = Region::numbered(&self.constants, self.regions[group]);
        let lame = region.map_or(with.lame, Region::lame);
        let twists = tension.filter(|_| with.law.rotates()).map(|tension| {
            // Without inertia nothing is heavy.
            let own = region.map_or(tension.density_kg_m3, |region| region.density_kg_m3);
            let density = if tension.density_kg_m3 > 0.0 { own } else { 0.0 };
            TwistCoefficients::new(lame, density, tension.s, with.scale)
        });
        let damping = tension.map_or(0.0, |tension| tension.damping as f32);
        let s = tension.map_or(with.scale, |tension| tension.s);
        let definite = tension.is_none_or(|tension| tension.definite);
        let law = LawCoefficients::new(with.law, lame, s, with.scale - s, definite);
        Coefficients { law, twists, damping, ..Coefficients::of(with, lame) }
    }
}

impl Coefficients {
    /// Those of an update for a material of these Lamé constants.
    pub(super) fn of(with: &ElasticUpdate, Lame { mu, lambda }: Lame) -> Self {
        let (mu, lambda, scale) = (mu as f32, lambda as f32, with.scale as f32);
        Self { mu, lambda, scale, rotates: with.law != Law::Linear, law: None, twists: None, damping: 0.0 }
    }
}

fn bisect(order: &mut [u32], parts: usize, centres: &[Vector3<f64>], emit: &mut dyn FnMut(&[u32])) {
    if parts <= 1 {
        if !order.is_empty() {
            emit(order);
        }
        return;
    }
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for &p in order.iter() {
        low = low.inf(&centres[p as usize]);
        high = high.sup(&centres[p as usize]);
    }
    let axis = (high - low).imax();
    let left = parts / 2;
    let middle = (order.len() * left / parts).min(order.len() - 1);
    order.select_nth_unstable_by(middle, |&a, &b| {
        centres[a as usize][axis].total_cmp(&centres[b as usize][axis]).then(a.cmp(&b))
    });
    let (first, second) = order.split_at_mut(middle);
    bisect(first, left, centres, emit);
    bisect(second, parts - left, centres, emit);
}

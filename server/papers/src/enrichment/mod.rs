//! The enrichments of the extended finite element method, compared on elements and bodies that are cut in two: the
//! same displacements, other condition numbers, costs and critical time steps. No step of the simulation uses them:
//! it works with pieces of elements and copies of nodes (`scindo_physics::cut`), whose masses are lumped there.
//!
//! The enrichments of the literature span the same displacements and are linear changes of variables.
//! [`EnrichedView`](view::EnrichedView) writes a whole cut body in any of the bases, whatever its law, and [`bases`]
//! solves it in each. [`EnrichedTet`](enriched_tet::EnrichedTet) has the forces and stiffness blocks of one element as
//! in the papers, with corrections. [`CutElement`](cut_element::CutElement) has the masses and the critical time step
//! of an element, and [`steps`] draws the published curves. `scindo accuracy enriched` shows all of it.
//!
//! # Definitions
//! The cut divides an element into side L (H = −1) and side R (H = +1); H_i is the side of node i.
//! On the piece of side H the displacement is
//!
//!   u = Σ_i N_i u_i + Σ_i ψ_i(H) N_i a_i
//!
//! | enrichment | ψ_i(H) | source |
//! |---|---|---|
//! | [`Heaviside`](basis::Enrichment::Heaviside) | H | Belytschko & Black 1999, Moës et al. 1999 |
//! | [`ShiftedHeaviside`](basis::Enrichment::ShiftedHeaviside) | (H − H_i)/2 | Zi & Belytschko 2003 |
//! | [`OwnSide`](basis::Enrichment::OwnSide) | \|H + H_i\|/2 | what published curves of the shifted one were made with |
//! | [`Substitution`](basis::Enrichment::Substitution) | every piece a whole element with copies of its own | Molino et al. 2004 |
//!
//! With constant gradients K = Σ_pieces w P_Hᵀ K_e P_H, where w is the volume fraction of the piece
//! and P_H [u; a] = u_i + ψ_i(H) a_i; only the consistent mass needs the moments ∫ N_i N_j over the
//! pieces.
//!
//! | [`Lumping`](lumping::Lumping) | standard dofs | enriched dofs | substitution |
//! |---|---|---|---|
//! | `Consistent` | ∫ρ N_i N_j, full matrix over u and a | | per piece |
//! | `RowSum` | row sums of the standard block | row sums of the enriched block | row sums per piece |
//! | `Hrz` | s M_ii | s M_ii with the same s = m / Σ M_ii over the standard block | s per piece, so that its mass is kept |
//! | `HrzBlockMass` | s M_ii | scaled to the row-sum mass of the enriched block | as `Hrz` |
//! | `HrzAsPrinted` | m M_ii / Σ_j M_ij, more than m in all | likewise | likewise with the mass of the piece |
//! | `Menouillard` | m/n | (m/n) ∫ψ_i² / \|Ω\| (Menouillard et al. 2006) | (m/n) w |
//! | `Copies` | ∫ρ N_i over the pieces as 2×2 blocks of u_i and a_i, M_ua included | | row sums per piece |
//!
//! Hinton, Rock & Zienkiewicz 1976 is HRZ. For undamped central differences (and symplectic Euler)
//! Δt_c = 2/ω_max of K − ω² M; ratios are taken against the uncut element with masses m/n.

pub mod basis;

mod error;

pub mod lumping;

mod spectrum;

mod pieces;

pub mod cut_element;

mod mass;

pub mod enriched_tet;

pub mod view;

pub mod steps;

pub mod bases;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

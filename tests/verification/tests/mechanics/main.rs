//! The mechanics held against independent solutions, closed forms and orders of convergence.

#![allow(clippy::unwrap_used)]
#![allow(non_snake_case)] // the symbols of the field: F, P, K, M

mod beam_case;
mod bodies;
mod cut_through_elements;
mod degenerate_elements;
mod drooping_bar;
mod eigenfrequencies;
mod estimates;
mod explicit;
mod fibres;
mod field;
mod half_cut_beam;
mod manufactured;
mod near_incompressible;
mod nienhuys;
mod patch;
mod ruined_starts;
mod same_mesh_beam;
mod slivers;
mod solvers;
mod spinning;
mod support;
mod time_orders;
mod xfem_beam;

//! The step: tools, cuts, contacts, deformation, in this order.

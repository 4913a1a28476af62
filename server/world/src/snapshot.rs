//! What other threads see of a simulation: one coherent copy per step.

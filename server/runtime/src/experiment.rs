//! Experiments on virtual time: what a hand feels over a link, against the truth, and a whole session in a simulated
//! network with faults. Both draw their chance from a seed.

pub mod chance;
pub mod haptics;
pub mod reliability;

//! The reference of a case: the right answer, and how well it is known.

pub mod value;

pub mod richardson;

pub mod limit;

pub mod settle;

pub mod climb;

pub use climb::Climb;
pub use settle::settle;
pub use value::Reference;

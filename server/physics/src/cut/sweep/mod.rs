//! What a blade does: where its sweep crosses the material, and which fragments that takes apart.

pub(crate) mod blade;
pub(crate) mod bit_marks;
pub(crate) mod sweep_triangle;
pub(crate) mod front;
pub(crate) mod swept_area;
pub(crate) mod detect;
pub(crate) mod separate;

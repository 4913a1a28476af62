//! From a blade sweep to separated fragments: where the sweep crosses the material, and what it cuts apart.

pub(crate) mod blade;
pub(crate) mod bit_marks;
pub(crate) mod sweep_triangle;
pub(crate) mod front;
pub(crate) mod borders;
pub(crate) mod front_elements;
pub(crate) mod swept_area;
pub(crate) mod detect;
pub(crate) mod separate;

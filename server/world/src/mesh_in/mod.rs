//! Imports meshes: a file or a built-in shape is checked, repaired and turned into tetrahedra.
//!
//! Volumes (tetrahedra) are checked and repaired. Surfaces (triangles), closed or dirty, are filled with a
//! lattice of tetrahedra whose boundary follows them.

mod triangle_tree;
mod health;
mod estimate;
mod progress;
mod lattice;
mod implicit;
mod organ;
mod solid_surface;
mod cubes;
mod load;
mod write;
#[cfg(test)]
mod shapes;

pub use cubes::{FillError, OctreeReport, fill_observed};
pub use estimate::{CELLS, MeshEstimate, estimate, largest, memory_for_meshes};
pub(crate) use estimate::{body_bytes, most_cells};
pub(crate) use health::connectivity::components;
pub use health::scale::{ScaleWarning, check_scale};
pub use health::surface::SurfaceHealth;
pub(crate) use health::surface::clean_surface;
pub use health::volume::{VolumeHealth, repair_volume};
pub use lattice::{LatticeReport, lattice_from_surface};
pub use load::{MeshHealth, load_any, load_surface, load_volume};
pub use organ::Organ;
pub use progress::{Meshing, Observer};
pub use solid_surface::SolidSurface;
pub use write::write_mesh;

//! Estimates the size, memory and time of a lattice before it is made.
//!
//! The constants were measured on lattices of a liver and a scan from 16 to 128 cells across. They include
//! the simulation of the body afterwards, which needs more memory than the meshing.

use serde::Serialize;

/// Allowed numbers of lattice cubes across the longest side.
pub const CELLS: std::ops::RangeInclusive<usize> = 2..=256;

/// Tetrahedra per cube of lattice volume, including those at the surface.
const TETS_PER_CUBE: f64 = 12.5;
/// Bytes per tetrahedron, for the mesh and the body made of it.
const BYTES_PER_TET: f64 = 800.0;
/// Bytes per node of the lattice, including nodes outside the body.
const BYTES_PER_NODE: f64 = 60.0;
/// Seconds per tetrahedron, for splitting, repair, measurement and the body.
const SECONDS_PER_TET: f64 = 5e-6;
/// Seconds per node of the lattice, for the inside test.
const SECONDS_PER_NODE: f64 = 1.5e-6;
/// Share of the free memory that a mesh may take.
const SHARE: f64 = 0.8;

/// Estimated cost of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeshEstimate {
    /// Lattice cubes across the longest side.
    pub cells: usize,
    /// Expected number of tetrahedra.
    pub tets: f64,
    /// Memory [bytes].
    pub bytes: f64,
    /// Rough time on this machine [s].
    pub seconds: f64,
}

/// Cost of a lattice of `cells` cubes across, for a body of this size [m] and volume [m³].
pub fn estimate(size_m: [f64; 3], volume_m3: f64, cells: usize) -> MeshEstimate {
    let longest_m = size_m.into_iter().fold(0.0, f64::max);
    let spacing_m = longest_m / cells as f64;
    let cubes: f64 = size_m.iter().map(|side| (side / spacing_m).ceil() + 3.0).product();
    let tets = TETS_PER_CUBE * (volume_m3.abs() / spacing_m.powi(3)).min(cubes);
    let nodes = 2.0 * cubes;
    let threads = std::thread::available_parallelism().map_or(1.0, |n| n.get() as f64);
    MeshEstimate {
        cells,
        tets,
        bytes: tets * BYTES_PER_TET + nodes * BYTES_PER_NODE,
        seconds: tets * SECONDS_PER_TET + nodes * SECONDS_PER_NODE / threads,
    }
}

/// The most cells whose mesh takes no more than `bytes`.
pub fn largest(size_m: [f64; 3], volume_m3: f64, bytes: f64) -> usize {
    let fits = |cells: &usize| estimate(size_m, volume_m3, *cells).bytes <= bytes;
    CELLS.rev().find(fits).unwrap_or(*CELLS.start())
}

/// Most cells that a user may request.
pub(crate) fn most_cells() -> usize {
    *CELLS.end()
}

/// Memory [bytes] of a body of `tets` tetrahedra.
pub(crate) fn body_bytes(tets: f64) -> f64 {
    tets * BYTES_PER_TET
}

/// Memory available for meshes on this machine [bytes]; infinite where the system does not report it.
pub fn memory_for_meshes() -> f64 {
    let meminfo = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let available = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kibibytes = available.and_then(|rest| rest.trim().trim_end_matches("kB").trim().parse::<f64>().ok());
    // In a container the limit may be lower than the memory of the machine.
    let read = |path: &str| std::fs::read_to_string(path).ok()?.trim().parse::<f64>().ok();
    let group = read("/sys/fs/cgroup/memory.max")
        .map(|most| most - read("/sys/fs/cgroup/memory.current").unwrap_or(0.0));
    let machine = kibibytes.map_or(f64::INFINITY, |kibibytes| 1024.0 * kibibytes);
    SHARE * machine.min(group.unwrap_or(f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finer_lattices_take_more_and_what_fits_is_found() {
        let size = [0.2, 0.15, 0.1];
        let [coarse, fine] = [32, 64].map(|cells| estimate(size, 1e-3, cells));
        assert!((7.0..9.0).contains(&(fine.tets / coarse.tets)), "{coarse:?} {fine:?}");
        assert!(fine.bytes > coarse.bytes && fine.seconds > coarse.seconds);
        assert_eq!(largest(size, 1e-3, fine.bytes), 64);
        assert_eq!(largest(size, 1e-3, f64::INFINITY), *CELLS.end());
        assert!(memory_for_meshes() > 1e6);
    }
}

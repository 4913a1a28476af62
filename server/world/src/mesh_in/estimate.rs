//! What a lattice will take, before it is made: tetrahedra, memory and time.
//!
//! The figures were measured on lattices of a liver and a scan from 16 to 128 cells across; they hold for a
//! body that is simulated afterwards, which needs more memory than the meshing.

use serde::Serialize;

/// Fewest and most lattice cubes across the longest side.
pub const CELLS: std::ops::RangeInclusive<usize> = 2..=256;

/// Tetrahedra per cube of lattice volume, those at the surface included.
const TETS_PER_CUBE: f64 = 12.5;
/// Bytes per tetrahedron of the mesh and of the body that is made of it.
const BYTES_PER_TET: f64 = 800.0;
/// Bytes per node of the lattice around the body.
const BYTES_PER_NODE: f64 = 60.0;
/// Seconds per tetrahedron: splitting, repair, measures, the body.
const SECONDS_PER_TET: f64 = 5e-6;
/// Seconds per node of the lattice: inside or outside.
const SECONDS_PER_NODE: f64 = 1.5e-6;
/// Share of the free memory that a mesh may take.
const SHARE: f64 = 0.8;

/// What a mesh takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeshEstimate {
    /// Lattice cubes across the longest side.
    pub cells: usize,
    /// Tetrahedra.
    pub tets: f64,
    /// Memory [bytes].
    pub bytes: f64,
    /// Time on this machine, roughly [s].
    pub seconds: f64,
}

/// A lattice of `cells` cubes across a body of this size [m] and volume [m³].
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

/// Most cells that may be asked for.
pub fn most_cells() -> usize {
    *CELLS.end()
}

/// Bytes that a body of so many tetrahedra takes.
pub fn body_bytes(tets: f64) -> f64 {
    tets * BYTES_PER_TET
}

/// Memory that a mesh may take on this machine [bytes]; endless where the system does not tell.
pub fn memory_for_meshes() -> f64 {
    let meminfo = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let available = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kibibytes = available.and_then(|rest| rest.trim().trim_end_matches("kB").trim().parse::<f64>().ok());
    // In a container the limit may be lower than what the machine has.
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

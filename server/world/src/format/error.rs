//! Errors of mesh files: where, what was found, what was expected, what to do.

use std::path::PathBuf;

/// Why a mesh file was refused. Every variant names the file and the next step.
#[derive(Debug, thiserror::Error)]
pub enum MeshInError {
    /// The file could not be opened or read.
    #[error("cannot read mesh file '{}': {source}; check the path (it is relative to the scene file)", path.display())]
    Io {
        /// Path as given.
        path: PathBuf,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// Neither the extension nor the first bytes name a known format.
    #[error("'{file}': unknown mesh format '{found}'; known are .msh .vtk .vtu .vtp .obj .stl .ply")]
    UnknownFormat {
        /// File name.
        file: String,
        /// Extension, or what the file starts with.
        found: String,
    },
    /// The text or bytes do not follow the format.
    #[error("'{file}', {place}: expected {expected}, found {found}")]
    Syntax {
        /// File name.
        file: String,
        /// Line or byte of the fault.
        place: String,
        /// What the format requires here.
        expected: String,
        /// What the file has instead.
        found: String,
    },
    /// The file follows the format, but this feature is not supported.
    #[error("'{file}', {place}: {what} is not supported; {instead}")]
    Unsupported {
        /// File name.
        file: String,
        /// Line or byte.
        place: String,
        /// The feature in words.
        what: String,
        /// What to do instead.
        instead: String,
    },
    /// A count announced by the file exceeds its bytes or the limit.
    #[error("'{file}', {place}: announces {value} {what}, but {reason} (at most {limit})")]
    Limit {
        /// File name.
        file: String,
        /// Line or byte.
        place: String,
        /// The item counted.
        what: String,
        /// Announced count.
        value: u64,
        /// Largest admissible count.
        limit: u64,
        /// Reason for that limit.
        reason: String,
    },
    /// An element names a node that does not exist.
    #[error(
        "'{file}': {element} {number} uses node {node}, but the file has {n_nodes} nodes; the file is damaged"
    )]
    NodeIndex {
        /// File name.
        file: String,
        /// "tetrahedron" or "triangle".
        element: &'static str,
        /// Its number in the file, from 0.
        number: usize,
        /// The index used (or the file's own node tag).
        node: i64,
        /// Nodes in the file.
        n_nodes: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("'{file}': node {node} has a non-finite coordinate ({x}, {y}, {z}); repair the file")]
    NonFinite {
        /// File name.
        file: String,
        /// Node number from 0.
        node: usize,
        /// x as found.
        x: f64,
        /// y as found.
        y: f64,
        /// z as found.
        z: f64,
    },
    /// The file holds no tetrahedra and no faces.
    #[error("'{file}': no tetrahedra and no triangles in it ({n_nodes} nodes); nothing to simulate")]
    Empty {
        /// File name.
        file: String,
        /// Nodes that the file has.
        n_nodes: usize,
    },
    /// Too many elements are useless.
    #[error(
        "'{file}': {bad} of {total} {element} are degenerate (limit {limit_percent} %); \
         remesh the body, or give its surface with `mesh = {{ surface = … }}`"
    )]
    TooManyDegenerate {
        /// File name.
        file: String,
        /// "tetrahedra" or "triangles".
        element: &'static str,
        /// Degenerate ones.
        bad: usize,
        /// Elements that the file has.
        total: usize,
        /// The largest share accepted [%].
        limit_percent: f64,
    },
    /// A surface was given where a volume mesh was asked for, or the other way round.
    #[error("'{file}' contains {found}, but the scene needs {wanted}; {instead}")]
    WrongKind {
        /// File name.
        file: String,
        /// What the file holds.
        found: &'static str,
        /// The kind of mesh that the scene asks for.
        wanted: &'static str,
        /// What to write in the scene.
        instead: &'static str,
    },
    /// The surface encloses nothing that the lattice could resolve.
    #[error(
        "'{file}': the surface encloses no lattice node at {cells} cells across ({detail}); raise `cells` or check that the surface is (nearly) closed"
    )]
    NothingInside {
        /// File name.
        file: String,
        /// Lattice cells across the longest side.
        cells: usize,
        /// Volume and hole counts.
        detail: String,
    },
    /// The lattice asked for is too coarse or too fine.
    #[error("'{file}': {cells} lattice cells across is outside {min}..={max}")]
    Cells {
        /// File name.
        file: String,
        /// Cells asked for.
        cells: usize,
        /// Fewest.
        min: usize,
        /// Most.
        max: usize,
    },
    /// The mesh would take more memory than there is.
    #[error(
        "'{file}': {cells} cells across make about {needs} may be used here. Use cells = {largest} at most"
    )]
    Memory {
        /// File name.
        file: String,
        /// Lattice cells across the longest side.
        cells: usize,
        /// Tetrahedra, memory needed and memory that there is, in words.
        needs: String,
        /// The most cells that fit.
        largest: usize,
    },
    /// A scale factor that is not a positive number.
    #[error("'{file}': scale = {scale} is not a positive finite number; use e.g. 0.001 for millimetres")]
    Scale {
        /// File name.
        file: String,
        /// The factor.
        scale: f64,
    },
    /// The mesh could not be written.
    #[error("cannot write mesh '{}': {reason}", path.display())]
    Write {
        /// Path of the output file.
        path: PathBuf,
        /// Reason in words.
        reason: String,
    },
}

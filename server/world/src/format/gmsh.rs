//! Gmsh `.msh`: format 1 (`$NOD`/`$ELM`), 2.x and 4.1, text and binary.
//!
//! # Source
//! Gmsh reference manual, "MSH file format" (4.1) and "Legacy formats" (1, 2).

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::cells::{CellKind, CellSoup};
use super::error::MeshInError;
use super::groups::{GMSH_PHYSICAL, Labels};
use super::mesh_file::MeshFile;
use super::scanner::{ByteOrder, Encoding, Scanner};

/// Reads a Gmsh file of any of the three formats.
pub(super) fn read(file: &str, bytes: &[u8]) -> Result<MeshFile, MeshInError> {
    let mut scanner = Scanner::new(file, bytes);
    let mut content = Content::default();
    let mut format = Format { version: Version::V1, encoding: Encoding::Text, size_width: 8 };
    if scanner.at_end() {
        return Err(scanner.expected("$MeshFormat or $NOD"));
    }
    while !scanner.at_end() {
        let at = scanner.clone();
        let section = scanner.word("a section such as $Nodes")?;
        match section {
            "$MeshFormat" => format = mesh_format(&mut scanner)?,
            "$PhysicalNames" => content.physical_names(&mut scanner)?,
            "$Entities" if format.version == Version::V4 => content.entities(&mut scanner, format)?,
            "$NOD" => content.nodes_v1(&mut scanner)?,
            "$ELM" => content.elements_v1(&mut scanner)?,
            "$Nodes" if format.version == Version::V4 => content.nodes_v4(&mut scanner, format)?,
            "$Nodes" => content.nodes_v2(&mut scanner, format)?,
            "$Elements" if format.version == Version::V4 => content.elements_v4(&mut scanner, format)?,
            "$Elements" => content.elements_v2(&mut scanner, format)?,
            _ => {
                let Some(name) = section.strip_prefix('$') else {
                    return Err(at.expected("a section such as $Nodes"));
                };
                if !scanner.skip_past(format!("$End{name}").as_bytes()) {
                    return Err(at.expected(format!("a section that is closed by $End{name}")));
                }
                continue;
            }
        }
        end_of_section(&mut scanner, section)?;
    }
    content.finish(file)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Version {
    V1,
    V2,
    V4,
}

#[derive(Clone, Copy)]
struct Format {
    version: Version,
    encoding: Encoding,
    /// Width of `size_t` in a binary 4.1 file [bytes].
    size_width: usize,
}

fn mesh_format(scanner: &mut Scanner) -> Result<Format, MeshInError> {
    let at = scanner.clone();
    let version = match scanner.word("a version number such as 4.1")? {
        "2" | "2.0" | "2.1" | "2.2" => Version::V2,
        "4.1" => Version::V4,
        other => {
            return Err(at.unsupported(
                format!("Gmsh format {other}"),
                "save it with `gmsh -format msh41` or `-format msh22`",
            ));
        }
    };
    let binary = scanner.integer("0 (text) or 1 (binary)")?;
    let width = scanner.integer("the data size, 4 or 8")?;
    if binary == 0 {
        return Ok(Format { version, encoding: Encoding::Text, size_width: 8 });
    }
    if width != 8 && width != 4 {
        return Err(at.unsupported(format!("data size {width}"), "use 8"));
    }
    scanner.line();
    let one = scanner.take(4, "the byte-order mark")?;
    let order = match one {
        [1, 0, 0, 0] => ByteOrder::Little,
        [0, 0, 0, 1] => ByteOrder::Big,
        _ => return Err(at.expected("the integer 1 as byte-order mark after the format line")),
    };
    Ok(Format { version, encoding: Encoding::Binary(order), size_width: width as usize })
}

fn end_of_section(scanner: &mut Scanner, section: &str) -> Result<(), MeshInError> {
    let name = section.trim_start_matches('$');
    let wanted = if matches!(name, "NOD" | "ELM") { format!("$END{name}") } else { format!("$End{name}") };
    if scanner.peek_word() != wanted {
        return Err(scanner.expected(wanted));
    }
    scanner.word(&wanted)?;
    Ok(())
}

/// Nodes and elements gathered from all sections.
#[derive(Default)]
struct Content {
    nodes: Vec<Vector3<f64>>,
    tags: Vec<i64>,
    cells: CellSoup,
    /// Physical groups of cells.
    physical: Labels,
    /// Physical groups of the volumes of a 4.1 file, by tag.
    of_volume: BTreeMap<i64, Vec<i64>>,
}

/// Dimension of volumes.
const VOLUME: i64 = 3;
/// Physical groups that one entity may belong to.
const MOST_GROUPS_OF_ENTITY: usize = 64;

impl Content {
    /// `$PhysicalNames`: count, then `dimension number "name"` lines; text in binary files too.
    fn physical_names(&mut self, scanner: &mut Scanner) -> Result<(), MeshInError> {
        let n = scanner.count("physical names", 5)?;
        for _ in 0..n {
            let dimension = scanner.integer("the dimension of a physical group")?;
            let number = scanner.integer("the number of a physical group")?;
            let name = String::from_utf8_lossy(scanner.line()).trim().trim_matches('"').to_owned();
            if dimension == VOLUME {
                self.physical.names.insert(number, name);
            }
        }
        Ok(())
    }

    /// `$Entities`: numbers of points, curves, surfaces and volumes, then each with its tag, its box, its physical
    /// groups and, beyond points, the entities that bound it.
    fn entities(&mut self, scanner: &mut Scanner, format: Format) -> Result<(), MeshInError> {
        binary_starts(scanner, format);
        let mut counts = [0; 4];
        for count in &mut counts {
            *count = size(scanner, format, "entities", 1)?;
        }
        for (dimension, count) in (0..).zip(counts) {
            for _ in 0..count {
                let tag = scanner.stored_integer(format.encoding, 4, "an entity tag")?;
                let coordinates = if dimension == 0 { 3 } else { 6 };
                for _ in 0..coordinates {
                    scanner.stored_real(format.encoding, 8, "a coordinate")?;
                }
                let at = scanner.clone();
                let groups = entity_tags(scanner, format, "physical groups")?;
                if groups.len() > MOST_GROUPS_OF_ENTITY {
                    return Err(at.expected(format!("at most {MOST_GROUPS_OF_ENTITY} physical groups")));
                }
                if dimension > 0 {
                    entity_tags(scanner, format, "bounding entities")?;
                }
                if dimension == VOLUME {
                    self.of_volume.insert(tag, groups);
                }
            }
        }
        Ok(())
    }

    /// Puts the cell of this kind that comes next into a physical group; 0 is none.
    fn put_into(&mut self, group: i64, kind: CellKind) {
        if group != 0 && matches!(kind, CellKind::Tetrahedron { .. }) {
            self.physical.values.push((self.cells.count(), group));
        }
    }

    fn node(&mut self, tag: i64, position: Vector3<f64>) {
        self.tags.push(tag);
        self.nodes.push(position);
    }

    fn element(&mut self, at: &Scanner, kind: CellKind, nodes: &[i64]) -> Result<(), MeshInError> {
        if let CellKind::Refused(name) = kind {
            return Err(at.unsupported(
                format!("a {name} element"),
                "mesh the body with tetrahedra, or give its surface with `mesh = { surface = … }`",
            ));
        }
        if self.cells.add(kind, nodes) {
            Ok(())
        } else {
            Err(at.expected("enough nodes for this element type"))
        }
    }

    /// `$NOD`: count, then `number x y z` lines.
    fn nodes_v1(&mut self, scanner: &mut Scanner) -> Result<(), MeshInError> {
        let n = scanner.count("nodes", 8)?;
        for _ in 0..n {
            let tag = scanner.integer("a node number")?;
            let position = text_point(scanner)?;
            self.node(tag, position);
        }
        Ok(())
    }

    /// `$ELM`: count, then `number type reg-phys reg-elem number-of-nodes nodes…` lines.
    fn elements_v1(&mut self, scanner: &mut Scanner) -> Result<(), MeshInError> {
        let n = scanner.count("elements", 10)?;
        let mut nodes = Vec::new();
        for _ in 0..n {
            let at = scanner.clone();
            scanner.integer("an element number")?;
            let element_type = scanner.integer("an element type")?;
            let group = scanner.integer("a physical region")?;
            scanner.integer("an elementary region")?;
            let n_nodes = scanner.count("nodes of an element", 1)?;
            nodes.clear();
            for _ in 0..n_nodes {
                nodes.push(scanner.integer("a node number")?);
            }
            let kind = element_kind(element_type).map_or(CellKind::Ignored("unknown"), |(kind, _)| kind);
            self.put_into(group, kind);
            self.element(&at, kind, &nodes)?;
        }
        Ok(())
    }

    fn nodes_v2(&mut self, scanner: &mut Scanner, format: Format) -> Result<(), MeshInError> {
        let n = scanner.count("nodes", 8)?;
        binary_starts(scanner, format);
        for _ in 0..n {
            let tag = scanner.stored_integer(format.encoding, 4, "a node number")?;
            let position = stored_point(scanner, format)?;
            self.node(tag, position);
        }
        Ok(())
    }

    fn elements_v2(&mut self, scanner: &mut Scanner, format: Format) -> Result<(), MeshInError> {
        let total = scanner.count("elements", 8)?;
        binary_starts(scanner, format);
        let mut done = 0;
        let mut nodes = Vec::new();
        while done < total {
            let at = scanner.clone();
            // Text has one element per line, binary has blocks of elements of one type.
            let block = match format.encoding {
                Encoding::Text => {
                    scanner.integer("an element number")?;
                    let element_type = scanner.integer("an element type")?;
                    (element_type, 1, scanner.integer("the number of tags")?)
                }
                encoding @ Encoding::Binary(_) => (
                    scanner.stored_integer(encoding, 4, "an element type")?,
                    scanner.stored_integer(encoding, 4, "elements in the block")?,
                    scanner.stored_integer(encoding, 4, "the number of tags")?,
                ),
            };
            let (element_type, in_block, n_tags) = block;
            let (kind, n_nodes) = known_element(&at, element_type)?;
            if !(0..=16).contains(&n_tags) {
                return Err(at.expected("0 to 16 tags"));
            }
            if in_block < 1 || in_block as u64 > (total - done) as u64 {
                return Err(at.expected(format!("a block of 1 to {} elements", total - done)));
            }
            for _ in 0..in_block {
                if format.encoding != Encoding::Text {
                    scanner.stored_integer(format.encoding, 4, "an element number")?;
                }
                for tag in 0..n_tags {
                    let value = scanner.stored_integer(format.encoding, 4, "a tag")?;
                    if tag == 0 {
                        self.put_into(value, kind);
                    }
                }
                nodes.clear();
                for _ in 0..n_nodes {
                    nodes.push(scanner.stored_integer(format.encoding, 4, "a node number")?);
                }
                self.element(&at, kind, &nodes)?;
            }
            done += in_block as usize;
        }
        Ok(())
    }

    /// `numEntityBlocks numNodes minTag maxTag`, then per block a header, its tags, its coordinates.
    fn nodes_v4(&mut self, scanner: &mut Scanner, format: Format) -> Result<(), MeshInError> {
        binary_starts(scanner, format);
        let blocks = section_header(scanner, format, "nodes")?;
        let mut tags = Vec::new();
        for _ in 0..blocks {
            let dimension = scanner.stored_integer(format.encoding, 4, "an entity dimension")?;
            scanner.stored_integer(format.encoding, 4, "an entity tag")?;
            let parametric = scanner.stored_integer(format.encoding, 4, "0 or 1 (parametric)")?;
            let n = size(scanner, format, "nodes of a block", 7)?;
            tags.clear();
            for _ in 0..n {
                tags.push(scanner.stored_integer(format.encoding, format.size_width, "a node tag")?);
            }
            for &tag in &tags {
                let position = stored_point(scanner, format)?;
                if parametric != 0 {
                    for _ in 0..dimension.clamp(0, 3) {
                        scanner.stored_real(format.encoding, 8, "a parametric coordinate")?;
                    }
                }
                self.node(tag, position);
            }
        }
        Ok(())
    }

    fn elements_v4(&mut self, scanner: &mut Scanner, format: Format) -> Result<(), MeshInError> {
        binary_starts(scanner, format);
        let blocks = section_header(scanner, format, "elements")?;
        let mut nodes = Vec::new();
        for _ in 0..blocks {
            let at = scanner.clone();
            let dimension = scanner.stored_integer(format.encoding, 4, "an entity dimension")?;
            let entity = scanner.stored_integer(format.encoding, 4, "an entity tag")?;
            let groups = match dimension {
                VOLUME => self.of_volume.get(&entity).cloned().unwrap_or_default(),
                _ => Vec::new(),
            };
            let element_type = scanner.stored_integer(format.encoding, 4, "an element type")?;
            let (kind, n_nodes) = known_element(&at, element_type)?;
            let n = size(scanner, format, "elements of a block", 4)?;
            for _ in 0..n {
                scanner.stored_integer(format.encoding, format.size_width, "an element tag")?;
                groups.iter().for_each(|&group| self.put_into(group, kind));
                nodes.clear();
                for _ in 0..n_nodes {
                    nodes.push(scanner.stored_integer(format.encoding, format.size_width, "a node tag")?);
                }
                self.element(&at, kind, &nodes)?;
            }
        }
        Ok(())
    }

    fn finish(mut self, file: &str) -> Result<MeshFile, MeshInError> {
        self.physical.array = GMSH_PHYSICAL.to_owned();
        self.cells.label(self.physical);
        let mut index: Vec<(i64, u32)> = self.tags.iter().copied().zip(0u32..).collect();
        index.sort_unstable();
        let index_of = |tag: i64| {
            let slot = index.partition_point(|&(t, _)| t < tag);
            index.get(slot).filter(|&&(t, _)| t == tag).map(|&(_, i)| i)
        };
        self.cells.finish(file, self.nodes, index_of)
    }
}

/// Moves to the start of binary data, which follows the newline of the line before it.
fn binary_starts(scanner: &mut Scanner, format: Format) {
    if format.encoding != Encoding::Text {
        scanner.line();
    }
}

/// A count stored as `size_t`, bounded by the bytes that follow.
fn size(scanner: &mut Scanner, format: Format, what: &str, bytes_each: usize) -> Result<usize, MeshInError> {
    let value = scanner.stored_integer(format.encoding, format.size_width, what)?;
    let value =
        u64::try_from(value).map_err(|_| scanner.expected(format!("a non-negative number of {what}")))?;
    scanner.bounded(value, what, bytes_each)
}

/// A list of entity or group numbers of a 4.1 file: its length, then the numbers. Signs tell orientations.
fn entity_tags(scanner: &mut Scanner, format: Format, what: &str) -> Result<Vec<i64>, MeshInError> {
    let n = size(scanner, format, what, 1)?;
    (0..n).map(|_| Ok(scanner.stored_integer(format.encoding, 4, what)?.wrapping_abs())).collect()
}

/// Block count of a 4.1 section. The total and the tag range are not needed.
fn section_header(scanner: &mut Scanner, format: Format, what: &str) -> Result<usize, MeshInError> {
    let blocks = size(scanner, format, "blocks", 1)?;
    size(scanner, format, what, 1)?;
    scanner.stored_integer(format.encoding, format.size_width, "the smallest tag")?;
    scanner.stored_integer(format.encoding, format.size_width, "the largest tag")?;
    Ok(blocks)
}

fn text_point(scanner: &mut Scanner) -> Result<Vector3<f64>, MeshInError> {
    Ok(Vector3::new(scanner.real("x")?, scanner.real("y")?, scanner.real("z")?))
}

fn stored_point(scanner: &mut Scanner, format: Format) -> Result<Vector3<f64>, MeshInError> {
    let mut coordinate = |name| scanner.stored_real(format.encoding, 8, name);
    Ok(Vector3::new(coordinate("x")?, coordinate("y")?, coordinate("z")?))
}

fn known_element(at: &Scanner, element_type: i64) -> Result<(CellKind, usize), MeshInError> {
    element_kind(element_type).ok_or_else(|| {
        at.unsupported(
            format!("Gmsh element type {element_type}"),
            "save lines, triangles and tetrahedra only",
        )
    })
}

/// Kind and node count of a Gmsh element type.
fn element_kind(element_type: i64) -> Option<(CellKind, usize)> {
    use CellKind::{Ignored, Quad, Refused, Tetrahedron, Triangle};
    Some(match element_type {
        1 => (Ignored("line"), 2),
        2 => (Triangle, 3),
        3 => (Quad, 4),
        4 => (Tetrahedron { order: 1 }, 4),
        5 => (Refused("hexahedron"), 8),
        6 => (Refused("prism"), 6),
        7 => (Refused("pyramid"), 5),
        8 => (Ignored("line"), 3),
        9 => (Triangle, 6),
        10 => (Quad, 9),
        11 => (Tetrahedron { order: 2 }, 10),
        12 => (Refused("hexahedron"), 27),
        13 => (Refused("prism"), 18),
        14 => (Refused("pyramid"), 14),
        15 => (Ignored("point"), 1),
        16 => (Quad, 8),
        17 => (Refused("hexahedron"), 20),
        18 => (Refused("prism"), 15),
        19 => (Refused("pyramid"), 13),
        20 => (Triangle, 9),
        21 => (Triangle, 10),
        26 => (Ignored("line"), 4),
        29 => (Tetrahedron { order: 3 }, 20),
        30 => (Tetrahedron { order: 4 }, 35),
        _ => return None,
    })
}

#[cfg(test)]
#[path = "gmsh_tests.rs"]
mod tests;

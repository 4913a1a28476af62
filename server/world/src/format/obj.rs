//! Wavefront `.obj` surfaces, by `tobj`; polygons become triangle fans.

use std::io::Cursor;
use std::path::Path;

use nalgebra::Vector3;

use super::cells::{CellKind, CellSoup, zero_based};
use super::error::MeshInError;
use super::mesh_file::{MeshFile, TexturedSurface};
use super::scanner::Scanner;

/// What a line of the file should be.
const LINES: &str = "a line of an OBJ file (v, vn, vt, f, g, o, …)";

/// Reads the positions and faces of all objects and groups in the file. Materials are ignored.
pub(super) fn read(file: &str, bytes: &[u8]) -> Result<MeshFile, MeshInError> {
    let models = models(file, bytes, &without(&["vn", "vt"], bytes))?;
    let Gathered { vertices, cells, .. } = gather(&models);
    let n = vertices.len();
    cells.finish(file, vertices, zero_based(n))
}

/// Reads a surface whose corners all have texture coordinates.
///
/// # Errors
/// As [`super::read_mesh`] for an `.obj` file; a corner without texture coordinates; a file of another format.
pub fn read_textured(path: &Path) -> Result<TexturedSurface, MeshInError> {
    let file = path.display().to_string();
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if extension != "obj" {
        return Err(MeshInError::WrongKind {
            file,
            found: "no texture coordinates that are read",
            wanted: "an .obj file with them",
            instead: "give that file as `surface`, or `repeat_m` in its place",
        });
    }
    read_textured_bytes(&file, &super::read_bytes(path)?)
}

/// Reads such a surface from memory. `file` is its name.
///
/// # Errors
/// As [`read_textured`].
pub fn read_textured_bytes(file: &str, bytes: &[u8]) -> Result<TexturedSurface, MeshInError> {
    every_corner_has_coordinates(file, bytes)?;
    let models = models(file, bytes, &without(&["vn"], bytes))?;
    let Gathered { vertices, cells, coordinates } = gather(&models);
    super::all_finite(file, &vertices)?;
    let n = vertices.len();
    let MeshFile::Surface(surface) = cells.finish(file, vertices, zero_based(n))? else {
        return Err(MeshInError::Empty { file: file.into(), n_nodes: n });
    };
    if let Some(triangle) =
        coordinates.iter().position(|corners| corners.iter().flatten().any(|c| !c.is_finite()))
    {
        return Err(MeshInError::Syntax {
            file: file.into(),
            place: format!("triangle {triangle}"),
            expected: "finite texture coordinates".into(),
            found: format!("{:?}", coordinates[triangle]),
        });
    }
    Ok(TexturedSurface { vertices: surface.vertices, triangles: surface.triangles, coordinates })
}

fn models(file: &str, bytes: &[u8], cleaned: &[u8]) -> Result<Vec<tobj::Model>, MeshInError> {
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    let mut cursor = Cursor::new(cleaned);
    let loaded = tobj::load_obj_buf(&mut cursor, &options, |_| Ok(Default::default()));
    loaded.map(|(models, _)| models).map_err(|error| {
        let mut scanner = Scanner::new(file, bytes);
        // tobj reads line by line, so the fault is in the line that ends at the cursor.
        let read = (cursor.position() as usize).min(bytes.len()).saturating_sub(1);
        let _ = scanner.take(read, "lines already read");
        let (place, expected) = (scanner.place(), LINES.into());
        MeshInError::Syntax { file: file.into(), place, expected, found: error.to_string() }
    })
}

/// What all models of a file have.
#[derive(Default)]
struct Gathered {
    vertices: Vec<Vector3<f64>>,
    cells: CellSoup,
    /// Texture coordinates of the triangles, if the models have any.
    coordinates: Vec<[[f32; 2]; 3]>,
}

fn gather(models: &[tobj::Model]) -> Gathered {
    let mut gathered = Gathered::default();
    let Gathered { vertices, cells, coordinates } = &mut gathered;
    let mut polygon = Vec::new();
    for tobj::Model { mesh, .. } in models {
        let first = vertices.len() as i64;
        let (points, _) = mesh.positions.as_chunks::<3>();
        vertices.extend(points.iter().map(|p| Vector3::from(p.map(f64::from))));
        let (images, _) = mesh.texcoords.as_chunks::<2>();
        let mut corner = 0;
        let sizes = &mesh.face_arities;
        let n_faces = if sizes.is_empty() { mesh.indices.len() / 3 } else { sizes.len() };
        for face in 0..n_faces {
            let size = sizes.get(face).map_or(3, |&s| s as usize);
            polygon.clear();
            polygon.extend(mesh.indices.iter().skip(corner).take(size).map(|&i| first + i64::from(i)));
            let of_corner = |k: usize| {
                let image = mesh.texcoord_indices.get(corner + k).and_then(|&i| images.get(i as usize));
                image.copied()
            };
            // Faces with fewer than three corners (points and lines in disguise) have no area.
            if cells.add(CellKind::Polygon, &polygon) && !images.is_empty() {
                let fan = (1..size - 1).map(|k| [0, k, k + 1].map(|k| of_corner(k).unwrap_or_default()));
                coordinates.extend(fan);
            }
            corner += size;
        }
    }
    gathered
}

/// The file with lines of these kinds commented out; all places stay. Nobody reads them, and tobj panics on a face that
/// refers to one that cannot be.
fn without(kinds: &[&str], bytes: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for line in out.split_mut(|&byte| byte == b'\n') {
        // tobj refuses a line that is not UTF-8.
        let Ok(text) = std::str::from_utf8(line) else { continue };
        let rest = text.trim_start();
        if rest.split_whitespace().next().is_some_and(|kind| kinds.contains(&kind)) {
            let at = text.len() - rest.len();
            line[at..at + 2].copy_from_slice(b"# ");
        }
    }
    out
}

/// Checks that every corner of a face names texture coordinates that are there: `v/vt` or `v/vt/vn`, from 1, or
/// backwards from −1.
fn every_corner_has_coordinates(file: &str, bytes: &[u8]) -> Result<(), MeshInError> {
    let lines =
        || bytes.split(|&byte| byte == b'\n').map(|line| std::str::from_utf8(line).unwrap_or_default());
    let all = lines().filter(|line| line.split_whitespace().next() == Some("vt")).count() as i64;
    let mut known: i64 = 0;
    for (number, line) in lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("vt") => known += 1,
            Some("f") => {
                for corner in words {
                    let named = corner.split('/').nth(1).and_then(|vt| vt.parse::<i64>().ok());
                    // Coordinates may follow the faces that name them, but not count backwards then.
                    if named.is_some_and(|vt| (1..=all).contains(&vt) || (-known..0).contains(&vt)) {
                        continue;
                    }
                    return Err(MeshInError::Syntax {
                        file: file.into(),
                        place: format!("line {}", number + 1),
                        expected: format!(
                            "a face whose corners name one of {all} texture coordinates, as 1/1"
                        ),
                        found: format!("the corner `{}`", corner.chars().take(40).collect::<String>()),
                    });
                }
            }
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// The indices of normals and texture coordinates are so large that arithmetic with them overflows.
    #[test]
    fn normals_that_cannot_be_do_no_harm() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n \u{a0}vt 0 0\n\
                    f 1/-9223372036854775808/-9223372036854775808 2//9223372036854775807 3//4\n";
        let mesh = read("a.obj", text.as_bytes()).unwrap();
        assert!(format!("{mesh:?}").contains("[0, 1, 2]"), "{mesh:?}");
        let wrong = read("a.obj", b"vn 0 0 1\nv 0 0 0\nf 1//1 2//1 x\n").unwrap_err().to_string();
        assert!(wrong.contains("line 3"), "{wrong}");
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";

    #[test]
    fn a_face_becomes_a_fan_with_its_texture_coordinates() {
        let mesh =
            read_textured_bytes("a.obj", format!("{SQUARE}f 1/4/1 2/3/1 3/2/1 4/1/1\n").as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        let expected: [[[f32; 2]; 3]; 2] = [[[0., 1.], [1., 1.], [1., 0.]], [[0., 1.], [1., 0.], [0., 0.]]];
        assert_eq!(mesh.coordinates, expected);
        let backwards =
            read_textured_bytes("a.obj", format!("{SQUARE}f 1/-1 2/-2 3/-3\n").as_bytes()).unwrap();
        assert_eq!(backwards.coordinates, expected[..1]);
    }

    #[test]
    fn a_corner_without_texture_coordinates_is_named() {
        for corner in ["3", "3//1", "3/0", "3/-5", "3/9223372036854775807", "3/-9223372036854775808", "3/99"]
        {
            let wrong =
                read_textured_bytes("a.obj", format!("{SQUARE}f 1/1 2/2 {corner}\n").as_bytes()).unwrap_err();
            let wrong = wrong.to_string();
            assert!(wrong.contains("line 10") && wrong.contains("texture coordinates"), "{wrong}");
        }
    }
}

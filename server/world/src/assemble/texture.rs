//! Reads the image on the skin of a body, and the surface that it was made for.

use std::path::Path;

use super::mesh::fault;
use crate::body::texture::{Atlas, Image, Mapping, Texture};
use crate::format::{inside, read_textured};
use crate::scene::{Fault, MeshSource, TextureMapping, TextureSpec};

/// Largest file of an image [bytes].
const MAX_BYTES: u64 = 16 << 20;
/// Most pixels along a side; older graphics cards take no more.
const MAX_PIXELS: usize = 8192;

/// The texture of a body whose mesh comes from `source`; paths are relative to `base_dir`. Its skin is `worn` if it consists
/// of triangles of a surface. The fault comes with its key.
pub(super) fn load(
    spec: &TextureSpec,
    source: &MeshSource,
    worn: bool,
    base_dir: &Path,
) -> Result<Texture, (&'static str, Fault)> {
    let image = image(&base_dir.join(&spec.image)).map_err(|fault| ("image", fault))?;
    let mapping = mapping(&spec.mapping, source, worn, base_dir).map_err(|fault| ("surface", fault))?;
    Ok(Texture::new(image, mapping))
}

fn image(path: &Path) -> Result<Image, Fault> {
    let refused = |reason: String, next: &str| refused(path, reason, next);
    let bytes = bytes(path)?;
    let media_type = match imagesize::image_type(&bytes) {
        Ok(imagesize::ImageType::Png) => "image/png",
        Ok(imagesize::ImageType::Jpeg) => "image/jpeg",
        _ => return Err(refused("it is no PNG and no JPEG file".into(), "save it as one of these")),
    };
    let size = imagesize::blob_size(&bytes)
        .map_err(|error| refused(format!("its size is not in it ({error})"), "save it again"))?;
    if !(1..=MAX_PIXELS).contains(&size.width) || !(1..=MAX_PIXELS).contains(&size.height) {
        let found =
            format!("it has {} × {} pixels, allowed: 1 to {MAX_PIXELS} a side", size.width, size.height);
        return Err(refused(found, "save it smaller"));
    }
    Ok(Image { media_type, bytes: bytes.into() })
}

/// The bytes of an image file of at most [`MAX_BYTES`].
fn bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    if let Some(bytes) = inside(path) {
        return Ok(bytes.to_vec());
    }
    let unreadable = |error: std::io::Error| {
        refused(path, error.to_string(), "check the path, which is relative to the scene")
    };
    let length = std::fs::metadata(path).map_err(unreadable)?.len();
    if length > MAX_BYTES {
        let found =
            format!("it has {} MiB, and an image may have {}", length.div_ceil(1 << 20), MAX_BYTES >> 20);
        return Err(refused(path, found, "save it smaller, or as JPEG"));
    }
    std::fs::read(path).map_err(unreadable)
}

fn refused(path: &Path, reason: String, next: &str) -> Fault {
    Fault::File { path: path.display().to_string(), reason, next: next.to_owned() }
}

fn mapping(
    mapping: &TextureMapping,
    source: &MeshSource,
    worn: bool,
    base_dir: &Path,
) -> Result<Mapping, Fault> {
    let (path, scale) = match (mapping, source) {
        (TextureMapping::Axes(repeat_m), _) => return Ok(Mapping::Axes { repeat_m: *repeat_m }),
        (TextureMapping::Surface(Some((path, scale))), _) => (path, *scale),
        (TextureMapping::Surface(None), MeshSource::Surface { path, scale, .. }) => (path, *scale),
        (TextureMapping::Surface(None), _) => {
            let what = "the mesh was not made from a surface, so nothing says where the image lies on it";
            let next =
                "add `surface` with an .obj file that has texture coordinates, or `repeat_m` for a pattern";
            return Err(Fault::Conflict { what: what.into(), next: next.into() });
        }
    };
    let surface = read_textured(&base_dir.join(path)).map_err(fault)?;
    let atlas = Atlas::new(&surface, scale).map_err(|error| Fault::Mesh { reason: error.to_string() })?;
    Ok(Mapping::Atlas(Box::new(if worn { atlas.worn() } else { atlas })))
}

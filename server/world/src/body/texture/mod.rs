//! The image on the skin of a body, and where each triangle of the skin lies on it.
//!
//! Texture coordinates belong to places of the body at rest, so they do not change while it moves, and a cut only adds
//! places. They come from a surface that has them ([`Atlas`]), or from the axes of the body.

mod atlas;

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use bytes::Bytes;
use nalgebra::Vector3;

pub use atlas::Atlas;
use atlas::Place;

/// Places that are remembered at least.
const MOST_KNOWN: usize = 10_000;

/// An image file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// `image/png` or `image/jpeg`.
    pub media_type: &'static str,
    /// The file.
    pub bytes: Bytes,
}

/// Where the skin lies on the image.
#[derive(Debug)]
pub enum Mapping {
    /// Where the closest point of a surface with texture coordinates lies.
    Atlas(Box<Atlas>),
    /// Along the two axes that a triangle faces least, with an image of this size [m].
    Axes {
        /// Size of the image on the body [m].
        repeat_m: f64,
    },
}

/// An image on the skin of a body.
#[derive(Debug)]
pub struct Texture {
    /// The picture as it was read.
    pub image: Image,
    mapping: Mapping,
    /// Places of vertices that were looked up, by the bits of their rest positions.
    known: Mutex<HashMap<[u32; 3], Place>>,
}

/// Texture coordinates of the corners of a triangle.
pub type Corners = [[f32; 2]; 3];

impl Texture {
    /// An image, and where the skin lies on it.
    pub fn new(image: Image, mapping: Mapping) -> Self {
        Self { image, mapping, known: Mutex::default() }
    }

    /// Texture coordinates of triangles over vertices that rest here [m]. Places that were asked for before are not looked
    /// up again.
    pub fn coordinates(&self, rest: &[[f32; 3]], triangles: impl Iterator<Item = [u32; 3]>) -> Vec<Corners> {
        let atlas = match &self.mapping {
            Mapping::Atlas(atlas) => atlas,
            Mapping::Axes { repeat_m } => {
                return triangles.map(|t| along_axes(t.map(|v| rest[v as usize]), *repeat_m)).collect();
            }
        };
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        // Most of the places were left behind by cuts and adaptations.
        if known.len() > MOST_KNOWN + 4 * rest.len() {
            known.clear();
        }
        let mut places: Vec<Option<Place>> = vec![None; rest.len()];
        let mut place = |v: u32| {
            let x = rest[v as usize];
            let look_up = || *known.entry(x.map(f32::to_bits)).or_insert_with(|| atlas.place(wide(x)));
            *places[v as usize].get_or_insert_with(look_up)
        };
        triangles.map(|t| atlas.corners(t.map(|v| wide(rest[v as usize])), t.map(&mut place))).collect()
    }
}

/// Texture coordinates along the axes that a triangle of these corners [m] faces least.
fn along_axes(corners: [[f32; 3]; 3], repeat_m: f64) -> Corners {
    let [a, b, c] = corners.map(wide);
    let [u, v] = match (b - a).cross(&(c - a)).iamax() {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    };
    [a, b, c].map(|x| [(x[u] / repeat_m) as f32, (x[v] / repeat_m) as f32])
}

fn wide(x: [f32; 3]) -> Vector3<f64> {
    Vector3::from(x.map(f64::from))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

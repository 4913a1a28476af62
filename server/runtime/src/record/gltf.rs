//! Surfaces as a glTF 2.0 scene that moves: one mesh per body and key frame, shown in turn.
//!
//! Cuts change the number of vertices, so a frame is a mesh of its own. An animation scales the mesh of the present
//! frame to 1 and all others to 0, in steps. Triangles are shared between frames of one topology epoch.
//!
//! A skin with an image is drawn apart from the lips of cuts. Where the image does not go on, a surface vertex becomes
//! several vertices of the file.
//!
//! # Source
//! Khronos, glTF 2.0 Specification, sections 3.6 (buffers), 3.8 (textures), 3.11 (animations) and 4 (GLB).

mod split;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::animation::{self, Interpolation, Property};
use gltf_json::buffer::{self, Target};
use gltf_json::image::MimeType;
use gltf_json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::scene::{Node, Scene};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Accessor, Animation, Asset, Buffer, Image, Index, Material, Mesh, Root, Texture, texture};
use scindo_world::body::SimBody;
use scindo_world::inputs::Wants;
use scindo_world::scene::LookSpec;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::{BodySnapshot, Snapshot};
use serde_json::{Value, json};

use crate::error::RuntimeError;
use split::Split;

/// Most key frames of a file.
pub const MAX_FRAMES: usize = 50;
/// Colour of a body without one, 0xRRGGBB.
const PLAIN: u32 = 0x00b5_523f;
/// Colour that leaves an image as it is.
const WHITE: u32 = 0x00ff_ffff;
/// First word of a GLB file, and the types of its two chunks.
const MAGIC: u32 = 0x4654_6c67;
const JSON: u32 = 0x4e4f_534a;
const BIN: u32 = 0x004e_4942;

/// A scene in the making.
#[derive(Default)]
pub struct Gltf {
    root: Root,
    bytes: Vec<u8>,
    /// Simulated time of every frame [s], and its nodes.
    frames: Vec<(f32, Vec<Index<Node>>)>,
    /// Per body what its frames of one epoch share.
    shapes: Vec<Option<Shape>>,
    /// Per body the materials of its skin and of its lips.
    materials: Vec<[Index<Material>; 2]>,
    snapshot: Snapshot,
}

/// What the frames of one epoch of a body share.
struct Shape {
    epoch: u32,
    /// Triangles with their material.
    parts: Vec<(Index<Accessor>, Index<Material>)>,
    /// For an image: the surface vertex of every vertex, and the coordinates on the image.
    image: Option<(Vec<u32>, Index<Accessor>)>,
}

impl Gltf {
    /// An empty scene.
    pub fn new() -> Self {
        let generator = Some(concat!("scindo ", env!("CARGO_PKG_VERSION")).to_owned());
        let root = Root { asset: Asset { generator, ..Asset::default() }, ..Root::default() };
        Self { root, ..Self::default() }
    }

    /// Frames so far.
    pub fn frames(&self) -> usize {
        self.frames.len()
    }

    /// Adds the present surfaces of all bodies as a frame.
    pub fn add(&mut self, simulation: &mut Simulation) {
        let n = simulation.bodies().len();
        let wants = Wants { surface: vec![true; n], ..Wants::default() };
        let mut snapshot = std::mem::take(&mut self.snapshot);
        simulation.snapshot_into(&wants, &mut snapshot);
        if self.materials.is_empty() {
            self.shapes.resize_with(n, || None);
            for (body, spec) in simulation.bodies().iter().zip(&simulation.scene().bodies) {
                let materials = self.add_materials(body, &spec.look);
                self.materials.push(materials);
            }
        }
        let mut nodes = Vec::new();
        for (index, body) in snapshot.bodies.iter().enumerate() {
            if body.positions.is_empty() || body.topology.triangles.is_empty() {
                continue;
            }
            let known = self.shapes[index].take().filter(|shape| shape.epoch == body.topology.epoch);
            let shape = known.unwrap_or_else(|| self.shape(body, self.materials[index]));
            let primitives = self.primitives(body, &shape);
            self.shapes[index] = Some(shape);
            let name = Some(format!("{} at {:.3} s", body.id, snapshot.time_s));
            let mesh = self.root.push(Mesh {
                extensions: None,
                extras: Default::default(),
                name: name.clone(),
                primitives,
                weights: None,
            });
            // A viewer without animations shows the first frame.
            let scale = (!self.frames.is_empty()).then_some([0.0; 3]);
            nodes.push(self.root.push(Node { mesh: Some(mesh), name, scale, ..Node::default() }));
        }
        self.frames.push((snapshot.time_s as f32, nodes));
        self.snapshot = snapshot;
    }

    /// Materials of the skin and of the lips of a body.
    fn add_materials(&mut self, body: &SimBody, look: &LookSpec) -> [Index<Material>; 2] {
        let (colour, opacity) = (look.colour.unwrap_or(PLAIN), look.opacity as f32);
        let plain = self.root.push(material(&body.id, colour, opacity));
        let Some(texture) = &body.texture else { return [plain; 2] };
        let (name, extensions, extras) = (None, None, Default::default());
        let buffer_view = Some(self.view(&texture.image.bytes, None));
        let mime_type = Some(MimeType(texture.image.media_type.to_owned()));
        let source = self.root.push(Image { buffer_view, mime_type, name, uri: None, extensions, extras });
        let (name, extensions, extras, sampler) = (None, None, Default::default(), None);
        let index = self.root.push(Texture { name, sampler, source, extensions, extras });
        // The colour of the look tints the image.
        let tint = look.colour.unwrap_or(WHITE);
        let mut skin = material(&format!("{} (skin)", body.id), tint, opacity);
        let (tex_coord, extensions, extras) = (0, None, Default::default());
        skin.pbr_metallic_roughness.base_color_texture =
            Some(texture::Info { index, tex_coord, extensions, extras });
        [self.root.push(skin), plain]
    }

    /// What the frames of the present epoch share.
    fn shape(&mut self, body: &BodySnapshot, [skin, lips]: [Index<Material>; 2]) -> Shape {
        let topology = &body.topology;
        let epoch = topology.epoch;
        let Some(texture) = &body.texture else {
            return Shape { epoch, parts: vec![(self.indices(&topology.triangles), skin)], image: None };
        };
        let split = Split::new(topology, &topology.on_image(texture));
        let mut parts = vec![(self.indices(&split.skin), skin)];
        if !split.lips.is_empty() {
            parts.push((self.indices(&split.lips), lips));
        }
        let view = self.view(&bytes_of(&split.coordinates), Some(Target::ArrayBuffer));
        let (component, kind) = (ComponentType::F32, Type::Vec2);
        let coordinates = self.accessor(view, component, kind, split.coordinates.len(), None);
        Shape { epoch, parts, image: Some((split.source, coordinates)) }
    }

    /// The triangles of a frame.
    fn primitives(&mut self, body: &BodySnapshot, shape: &Shape) -> Vec<Primitive> {
        let attributes = match &shape.image {
            None => [(Valid(Semantic::Positions), self.positions(&body.positions))].into(),
            Some((source, coordinates)) => {
                let positions: Vec<[f32; 3]> = source.iter().map(|&v| body.positions[v as usize]).collect();
                let positions = (Valid(Semantic::Positions), self.positions(&positions));
                [positions, (Valid(Semantic::TexCoords(0)), *coordinates)].into()
            }
        };
        let primitive = |&(indices, material): &(Index<Accessor>, Index<Material>)| Primitive {
            attributes: BTreeMap::clone(&attributes),
            extensions: None,
            extras: Default::default(),
            indices: Some(indices),
            material: Some(material),
            mode: Valid(Mode::Triangles),
            targets: None,
        };
        shape.parts.iter().map(primitive).collect()
    }

    /// Writes the file.
    ///
    /// # Errors
    /// What the disk says.
    pub fn save(mut self, path: &Path) -> Result<(), RuntimeError> {
        self.animate();
        let nodes = self.frames.iter().flat_map(|(_, nodes)| nodes.iter().copied()).collect();
        let (extensions, extras) = (None, Default::default());
        let scene = self.root.push(Scene { extensions, extras, name: None, nodes });
        self.root.scene = Some(scene);
        if let Some(buffer) = self.root.buffers.first_mut() {
            buffer.byte_length = self.bytes.len().into();
        }
        let failed = |reason: String| RuntimeError::Export { file: path.display().to_string(), reason };
        let mut json = self.root.to_vec().map_err(|e| failed(e.to_string()))?;
        json.resize(json.len().next_multiple_of(4), b' ');
        let chunks = [(JSON, &json), (BIN, &self.bytes)];
        let chunks = chunks.into_iter().filter(|(_, bytes)| !bytes.is_empty());
        let length = 12 + chunks.clone().map(|(_, bytes)| 8 + bytes.len()).sum::<usize>();
        let too_long = || failed("a GLB file cannot be longer than 4 GiB; export fewer bodies".to_owned());
        let length = u32::try_from(length).map_err(|_| too_long())?;
        let mut file = Vec::with_capacity(length as usize);
        [MAGIC, 2, length].iter().for_each(|word| file.extend_from_slice(&word.to_le_bytes()));
        for (kind, bytes) in chunks {
            file.extend_from_slice(&(bytes.len() as u32).to_le_bytes());
            file.extend_from_slice(&kind.to_le_bytes());
            file.extend_from_slice(bytes);
        }
        fs::write(path, file).map_err(|e| failed(e.to_string()))
    }

    /// Shows the frames in turn.
    fn animate(&mut self) {
        if self.frames.len() < 2 {
            return;
        }
        let (mut channels, mut samplers) = (Vec::new(), Vec::new());
        let frames = std::mem::take(&mut self.frames);
        let begin = frames[0].0;
        for (k, (time_s, nodes)) in frames.iter().enumerate() {
            let next = frames.get(k + 1).map(|(next, _)| next - begin);
            let (mut times, mut scales) = (vec![0.0], vec![[if k == 0 { 1.0 } else { 0.0 }; 3]]);
            if k > 0 {
                times.push(time_s - begin);
                scales.push([1.0; 3]);
            }
            if let Some(next) = next {
                times.push(next);
                scales.push([0.0; 3]);
            }
            let (input, output) = (self.times(&times), self.vectors(&scales));
            for &node in nodes {
                let sampler = Index::new(samplers.len() as u32);
                samplers.push(animation::Sampler {
                    extensions: None,
                    extras: Default::default(),
                    input,
                    interpolation: Valid(Interpolation::Step),
                    output,
                });
                let (extensions, extras, path) = (None, Default::default(), Valid(Property::Scale));
                let target = animation::Target { extensions, extras, node, path };
                channels.push(animation::Channel {
                    sampler,
                    target,
                    extensions: None,
                    extras: Default::default(),
                });
            }
        }
        self.frames = frames;
        let name = Some("the recording".to_owned());
        let (extensions, extras) = (None, Default::default());
        self.root.push(Animation { extensions, extras, channels, name, samplers });
    }

    fn indices(&mut self, triangles: &[[u32; 3]]) -> Index<Accessor> {
        let bytes: Vec<u8> = triangles.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(Target::ElementArrayBuffer));
        self.accessor(view, ComponentType::U32, Type::Scalar, 3 * triangles.len(), None)
    }

    fn positions(&mut self, positions: &[[f32; 3]]) -> Index<Accessor> {
        let bytes = bytes_of(positions);
        let view = self.view(&bytes, Some(Target::ArrayBuffer));
        let (mut min, mut max) = ([f32::MAX; 3], [f32::MIN; 3]);
        for (k, &x) in positions.iter().flat_map(|x| x.iter().enumerate()) {
            (min[k], max[k]) = (min[k].min(x), max[k].max(x));
        }
        self.accessor(view, ComponentType::F32, Type::Vec3, positions.len(), Some([json!(min), json!(max)]))
    }

    fn vectors(&mut self, vectors: &[[f32; 3]]) -> Index<Accessor> {
        let bytes = bytes_of(vectors);
        let view = self.view(&bytes, None);
        self.accessor(view, ComponentType::F32, Type::Vec3, vectors.len(), None)
    }

    fn times(&mut self, times: &[f32]) -> Index<Accessor> {
        let bytes: Vec<u8> = times.iter().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes, None);
        let last = times.last().copied().unwrap_or(0.0);
        let range = Some([json!([0.0]), json!([last])]);
        self.accessor(view, ComponentType::F32, Type::Scalar, times.len(), range)
    }

    fn view(&mut self, bytes: &[u8], target: Option<Target>) -> Index<buffer::View> {
        if self.root.buffers.is_empty() {
            self.root.push(Buffer {
                byte_length: 0_usize.into(),
                name: None,
                uri: None,
                extensions: None,
                extras: Default::default(),
            });
        }
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        // Numbers stand at multiples of their size, whatever length an image has.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.root.push(buffer::View {
            buffer: Index::new(0),
            byte_length: bytes.len().into(),
            byte_offset: Some(offset.into()),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: Default::default(),
        })
    }

    fn accessor(
        &mut self,
        view: Index<buffer::View>,
        component: ComponentType,
        kind: Type,
        count: usize,
        range: Option<[Value; 2]>,
    ) -> Index<Accessor> {
        let (min, max) = range.map(|[min, max]| (min, max)).unzip();
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: count.into(),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: Default::default(),
            type_: Valid(kind),
            min,
            max,
            name: None,
            normalized: false,
            sparse: None,
        })
    }
}

fn bytes_of<const N: usize>(vectors: &[[f32; N]]) -> Vec<u8> {
    vectors.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
}

/// A dull material; `colour` is 0xRRGGBB in sRGB, and glTF takes linear light.
fn material(name: &str, colour: u32, opacity: f32) -> Material {
    let linear = |shift: u32| {
        let s = (colour >> shift & 0xff) as f32 / 255.0;
        if s <= 0.040_45 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
    };
    let factor = PbrBaseColorFactor([linear(16), linear(8), linear(0), opacity]);
    Material {
        name: Some(name.to_owned()),
        double_sided: true,
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: factor,
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.7),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    }
}

//! Surfaces as a glTF 2.0 scene that moves: one mesh per body and key frame, shown in turn.
//!
//! Cuts change the number of vertices, so a frame is a mesh of its own. An animation scales the mesh of the present
//! frame to 1 and all others to 0, in steps. Triangles are shared between frames of one topology epoch.
//!
//! # Source
//! Khronos, glTF 2.0 Specification, sections 3.6 (buffers), 3.11 (animations) and 4 (GLB).

use std::fs;
use std::path::Path;

use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::animation::{self, Interpolation, Property};
use gltf_json::buffer::{self, Target};
use gltf_json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::scene::{Node, Scene};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Accessor, Animation, Asset, Buffer, Index, Material, Mesh, Root};
use scindo_world::inputs::Wants;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;
use serde_json::{Value, json};

use crate::error::RuntimeError;

/// Most key frames of a file.
pub const MAX_FRAMES: usize = 50;
/// Colour of a body without one, 0xRRGGBB.
const PLAIN: u32 = 0x00b5_523f;
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
    /// Per body its epoch and the triangles of it.
    triangles: Vec<Option<(u32, Index<Accessor>)>>,
    materials: Vec<Index<Material>>,
    snapshot: Snapshot,
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
            self.triangles.resize(n, None);
            for body in &simulation.scene().bodies {
                let colour = body.look.colour.unwrap_or(PLAIN);
                let material = material(&body.id, colour, body.look.opacity as f32);
                self.materials.push(self.root.push(material));
            }
        }
        let mut nodes = Vec::new();
        for (index, body) in snapshot.bodies.iter().enumerate() {
            if body.positions.is_empty() || body.topology.triangles.is_empty() {
                continue;
            }
            let known = self.triangles[index].filter(|(epoch, _)| *epoch == body.topology.epoch);
            let indices = match known {
                Some((_, indices)) => indices,
                None => {
                    let indices = self.indices(&body.topology.triangles);
                    self.triangles[index] = Some((body.topology.epoch, indices));
                    indices
                }
            };
            let positions = self.positions(&body.positions);
            let attributes = [(Valid(Semantic::Positions), positions)].into();
            let primitive = Primitive {
                attributes,
                extensions: None,
                extras: Default::default(),
                indices: Some(indices),
                material: Some(self.materials[index]),
                mode: Valid(Mode::Triangles),
                targets: None,
            };
            let name = Some(format!("{} at {:.3} s", body.id, snapshot.time_s));
            let mesh = self.root.push(Mesh {
                extensions: None,
                extras: Default::default(),
                name: name.clone(),
                primitives: vec![primitive],
                weights: None,
            });
            // A viewer without animations shows the first frame.
            let scale = (!self.frames.is_empty()).then_some([0.0; 3]);
            nodes.push(self.root.push(Node { mesh: Some(mesh), name, scale, ..Node::default() }));
        }
        self.frames.push((snapshot.time_s as f32, nodes));
        self.snapshot = snapshot;
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

fn bytes_of(vectors: &[[f32; 3]]) -> Vec<u8> {
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

// The surface of one body on the GPU. Its topology changes with a cut, its positions with every frame.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Mesh, MeshLambertMaterial, Box3, type Plane } from "three";
import { smoothTopology, type RenderTopology } from "./smoothing";
import { accumulateNormals, gather } from "./normals";
import { partsOf, type Parts } from "./parts";
import { SkinDepth } from "./depth";
import { Tissue, type Look } from "./tissue";
import { SkinLines } from "./lines";
import type { SurfaceField, SurfaceFrame, SurfaceTopology } from "../gen/scindo/v1/surface_pb";

/** Fills `colours` (r g b per render vertex, linear) from the state of the body. */
export type Painter = (body: BodySurface, colours: Float32Array) => void;

export class BodySurface {
  readonly object: Mesh;
  readonly geometry = new BufferGeometry();
  readonly tissue: Tissue;
  /** Lines along incisions that have not opened yet. */
  readonly marks = new SkinLines(2.2);
  /** Edges between skin and wound. */
  readonly rims = new SkinLines(1.4);
  readonly bounds = new Box3();
  /** Bounds of the parts that hang on something held, or of the largest part if nothing is held. */
  readonly core = new Box3();
  isHeld = false;
  coreArea = 0;
  epoch = -1;
  vertexCount = 0;
  triangleCount = 0;
  lipTriangles = 0;
  /** Frames taken, and frames that waited for their topology. */
  frames = 0;
  unmatched = 0;
  simTimeS = 0;
  simStep = 0n;
  /** Positions of the surface vertices as received [m]. */
  positions: Float32Array = new Float32Array(0);
  /** Rest positions of the surface vertices [m]; empty if the server does not send them. */
  rest: Float32Array = new Float32Array(0);
  /** Triangles ready for drawing; null before the first frame. */
  render: RenderTopology | null = null;
  /** Von Mises stress of the surface vertices [Pa] and its epoch, while the page asks for it. */
  stress: { values: Float32Array; epoch: number } | null = null;
  /** Called after new positions went to the GPU. */
  onUpload: (body: BodySurface) => void = () => {};
  private readonly plain = new MeshLambertMaterial({ vertexColors: true, toneMapped: false });
  private painter: Painter | null = null;
  private topology: SurfaceTopology | null = null;
  private triangles = new Uint32Array(0);
  private held: Uint8Array = new Uint8Array(0);
  private inCore: Uint8Array | null = null;
  private skinDepth: SkinDepth | null = null;
  private parted: Parts | null = null;
  private look: Look | null = null;
  private isTextured = false;
  private stale = false;

  constructor(readonly id: string, readonly order: number) {
    this.tissue = new Tissue(order);
    this.object = new Mesh(this.geometry, [this.tissue.skin, this.tissue.lip]);
    this.object.frustumCulled = false;
    this.object.castShadow = true;
    this.object.receiveShadow = true;
    this.object.add(this.marks.object, this.rims.object);
  }

  setLook(look: Look): void {
    this.look = look;
    if (!look.textured) this.tissue.setImage(null);
    this.applyLook();
  }

  /** Shows an image on the skin, unless the scene to which it belonged has gone meanwhile. */
  setTexture(image: ImageBitmap): void {
    if (!this.look?.textured) return;
    this.tissue.setImage(image);
    this.applyLook();
    this.stale = true;
  }

  /** Colours the body by a painter; `null` restores the look of tissue. */
  paint(painter: Painter | null): void {
    this.painter = painter;
    this.object.material = painter ? [this.plain, this.plain] : [this.tissue.skin, this.tissue.lip];
    const room = this.geometry.getAttribute("position")?.count ?? 0;
    if (painter && room > 0) this.reserve(room, 0);
    else if (!painter) this.geometry.deleteAttribute("color");
    this.stale = true;
  }

  clip(planes: Plane[] | null): void {
    this.tissue.clip(planes);
    this.plain.clippingPlanes = planes;
    this.plain.side = planes ? 2 : 0;
    this.plain.needsUpdate = true;
    for (const lines of [this.marks, this.rims]) lines.clip(planes);
  }

  /** Keeps a topology until the first frame of its epoch brings positions. */
  setTopology(topology: SurfaceTopology): void {
    const triangles = topology.triangleCount;
    if (topology.triangles.length !== 12 * triangles || topology.tags.length !== 4 * triangles) return;
    this.topology = topology;
  }

  /** Takes a frame. Returns false if its topology has not arrived (yet). */
  setFrame(frame: SurfaceFrame): boolean {
    const vertices = frame.vertexCount;
    if (frame.positions.length !== 12 * vertices) return false;
    const waiting = this.topology;
    if (waiting && waiting.epoch === frame.epoch && waiting.vertexCount === vertices) {
      this.positions = floats(frame.positions, new Float32Array(3 * vertices));
      this.topology = null;
      if (!this.adopt(waiting)) return false;
    } else if (frame.epoch !== this.epoch || vertices !== this.vertexCount) {
      this.unmatched += 1;
      return false;
    } else {
      this.positions = floats(frame.positions, this.positions);
    }
    this.marks.take(frame.marks.length === 24 * frame.markCount ? floats(frame.marks, new Float32Array(6 * frame.markCount)) : null);
    this.frames += 1;
    this.simTimeS = frame.simTimeS;
    this.simStep = frame.simStep;
    this.stale = true;
    return true;
  }

  setField(field: SurfaceField): void {
    if (field.name !== "von-mises" || field.values.length !== 4 * field.vertexCount) return;
    this.stress = { values: floats(field.values, new Float32Array(field.vertexCount)), epoch: field.epoch };
    this.stale = true;
  }

  /** Sends positions and normals to the GPU if a new frame arrived since the last picture. */
  upload(): void {
    if (!this.stale || !this.render) return;
    this.stale = false;
    this.marks.upload();
    this.rims.follow(this.render.rims, this.positions);
    this.rims.upload();
    const position = this.geometry.getAttribute("position") as BufferAttribute;
    const normal = this.geometry.getAttribute("normal") as BufferAttribute;
    gather(this.positions, this.render.source, position.array as Float32Array, this.bounds, this.inCore, this.core);
    accumulateNormals(this.render, position.array as Float32Array, normal.array as Float32Array);
    for (const attribute of [position, normal]) this.send(attribute);
    if (this.painter) {
      const color = this.geometry.getAttribute("color") as BufferAttribute;
      this.painter(this, color.array as Float32Array);
      this.send(color);
    }
    this.onUpload(this);
  }

  /** Forces a new picture even without a new frame. */
  touch(): void {
    this.stale = true;
  }

  /** Connected parts of the present topology. */
  get parts(): Parts {
    this.parted ??= partsOf(this.triangles, this.vertexCount, this.positions);
    return this.parted;
  }

  /** Surface vertices that move with held nodes. */
  get heldVertices(): number[] {
    const vertices: number[] = [];
    for (let v = 0; v < this.vertexCount && this.held.length > 0; v++) if (bit(this.held, v)) vertices.push(v);
    return vertices;
  }

  dispose(): void {
    this.object.removeFromParent();
    this.geometry.dispose();
    this.tissue.dispose();
    this.plain.dispose();
    this.marks.dispose();
    this.rims.dispose();
  }

  private applyLook(): void {
    const radius = this.bounds.isEmpty() ? 0.1 : 0.5 * this.bounds.min.distanceTo(this.bounds.max);
    this.tissue.setLook(this.look ?? { opacity: 1, textured: false, layers: [] }, this.order, radius);
  }

  private adopt(topology: SurfaceTopology): boolean {
    const triangles = words(topology.triangles), tags = words(topology.tags);
    for (const v of triangles) if (v >= topology.vertexCount) return false;
    this.epoch = topology.epoch;
    this.vertexCount = topology.vertexCount;
    this.triangleCount = topology.triangleCount;
    this.triangles = triangles;
    this.held = topology.held;
    this.rest = topology.restPositions.length === 12 * topology.vertexCount
      ? floats(topology.restPositions, new Float32Array(3 * topology.vertexCount)) : new Float32Array(0);
    const first = this.render === null;
    const image = floats(topology.textureCoordinates, new Float32Array(topology.textureCoordinates.length / 4));
    this.render = smoothTopology(triangles, tags, this.positions, this.vertexCount, image);
    this.isTextured = image.length > 0;
    this.lipTriangles = this.triangleCount - this.render.skinTriangles;
    this.reserve(this.render.source.length, this.render.index.length);
    const index = this.geometry.index as BufferAttribute;
    (index.array as Uint32Array).set(this.render.index);
    index.clearUpdateRanges();
    index.addUpdateRange(0, this.render.index.length);
    index.needsUpdate = true;
    const skin = 3 * this.render.skinTriangles;
    this.geometry.clearGroups();
    this.geometry.addGroup(0, skin, 0);
    this.geometry.addGroup(skin, this.render.index.length - skin, 1);
    this.geometry.setDrawRange(0, this.render.index.length);
    if (this.isTextured) this.placeImage(image);
    this.parted = null;
    this.findCore(topology.hangs);
    this.findDepth();
    if (first) {
      this.bounds.setFromArray(this.positions as unknown as number[]);
      this.applyLook();
    }
    return true;
  }

  /** Sends the texture coordinates of the skin to the GPU: u v of the three corners of every skin triangle. */
  private placeImage(image: Float32Array): void {
    const uv = this.geometry.getAttribute("uv") as BufferAttribute;
    const values = uv.array as Float32Array;
    this.render!.corner.forEach((corner, v) => {
      if (2 * corner + 1 < image.length) values.set(image.subarray(2 * corner, 2 * corner + 2), 2 * v);
    });
    this.send(uv, 2);
  }

  /** Finds the vertices that the camera keeps in view. */
  private findCore(hangs: Uint8Array): void {
    const hanging = hangs.length > 0 ? Uint8Array.from({ length: this.vertexCount }, (_, v) => bit(hangs, v)) : null;
    this.isHeld = hanging !== null && hanging.includes(1);
    if (this.isHeld) {
      this.inCore = hanging!.includes(0) ? hanging : null;
      return;
    }
    const { of, area } = this.parts;
    this.coreArea = area[0] ?? 0;
    this.inCore = area.length > 1 ? Uint8Array.from(of, (part) => (part === 0 ? 1 : 0)) : null;
  }

  /** Computes the depth below the skin of every vertex on a lip. */
  private findDepth(): void {
    const { index, source, skinTriangles } = this.render!;
    if (this.lipTriangles === 0) {
      this.skinDepth = null;
      return;
    }
    if (this.rest.length === 0) return;
    this.skinDepth ??= new SkinDepth(index.slice(0, 3 * skinTriangles).map((r) => source[r]), this.rest);
    const depth = this.geometry.getAttribute("depth") as BufferAttribute;
    const values = depth.array as Float32Array;
    for (let c = 3 * skinTriangles; c < index.length; c++) {
      const s = 3 * source[index[c]];
      values[index[c]] = this.skinDepth.at(this.rest[s], this.rest[s + 1], this.rest[s + 2]);
    }
    this.send(depth, 1);
  }

  private send(attribute: BufferAttribute, size = 3): void {
    attribute.clearUpdateRanges();
    attribute.addUpdateRange(0, size * this.render!.source.length);
    attribute.needsUpdate = true;
  }

  /** Grows the buffers by half, so that a long cut does not create new ones at every epoch. */
  private reserve(vertices: number, indices: number): void {
    const position = this.geometry.getAttribute("position") as BufferAttribute | undefined;
    const grows = !position || position.count < vertices;
    const room = grows ? Math.ceil(vertices * 1.5) : position.count;
    if (grows && position) this.geometry.dispose();
    const named = { position: 3, normal: 3, depth: 1, ...(this.painter ? { color: 3 } : {}), ...(this.isTextured ? { uv: 2 } : {}) };
    for (const [name, size] of Object.entries(named)) {
      if (!grows && this.geometry.hasAttribute(name)) continue;
      const attribute = new BufferAttribute(new Float32Array(size * room), size);
      this.geometry.setAttribute(name, attribute.setUsage(DynamicDrawUsage));
    }
    if (!this.geometry.index || this.geometry.index.count < indices) {
      this.geometry.setIndex(new BufferAttribute(new Uint32Array(Math.ceil(indices * 1.5)), 1).setUsage(DynamicDrawUsage));
    }
  }
}

function bit(bits: Uint8Array, v: number): number {
  return (bits[v >> 3] >> (v & 7)) & 1;
}

/**
 * The bytes of a message as floats. They are copied into `room` only if they are not aligned to four bytes.
 */
function floats(bytes: Uint8Array, room: Float32Array): Float32Array {
  if (bytes.byteOffset % 4 === 0) return new Float32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4);
  const out = room.length === bytes.length / 4 && room.byteOffset === 0 ? room : new Float32Array(bytes.length / 4);
  new Uint8Array(out.buffer, out.byteOffset, bytes.length).set(bytes);
  return out;
}

function words(bytes: Uint8Array): Uint32Array<ArrayBuffer> {
  return new Uint32Array(bytes.slice().buffer);
}

// One body's surface on the GPU. Topology changes when a cut does; positions change every frame.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Mesh, Box3, Vector3 } from "three";
import { smoothTopology, type RenderTopology } from "./smoothing";
import { skinMaterial, lipMaterial } from "./tissue";
import { SkinLines } from "./lines";
import type { SurfaceFrame, SurfaceTopology } from "../gen/scindo/v1/surface_pb";

export class BodySurface {
  readonly object: Mesh;
  /** Lines along incisions that have not opened yet. */
  readonly marks = new SkinLines(2.2);
  /** Where skin ends at a wound. */
  readonly rims = new SkinLines(1.4);
  readonly bounds = new Box3();
  epoch = -1;
  vertexCount = 0;
  triangleCount = 0;
  lipTriangles = 0;
  /** Frames taken, frames that waited for their topology. */
  frames = 0;
  unmatched = 0;
  simTimeS = 0;
  simStep = 0n;
  /** Positions of the surface vertices as sent [m]. */
  positions: Float32Array = new Float32Array(0);
  /** Triangles as drawn; null before the first frame. */
  render: RenderTopology | null = null;
  private readonly geometry = new BufferGeometry();
  private topology: SurfaceTopology | null = null;
  private stale = false;

  constructor(readonly id: string, order: number) {
    this.object = new Mesh(this.geometry, [skinMaterial(order), lipMaterial()]);
    this.object.frustumCulled = false;
    this.object.castShadow = true;
    this.object.receiveShadow = true;
    this.object.add(this.marks.object, this.rims.object);
  }

  /** Keeps the topology until the first frame of its epoch gives it positions. */
  setTopology(topology: SurfaceTopology): void {
    const triangles = topology.triangleCount;
    if (topology.triangles.length !== 12 * triangles || topology.tags.length !== 4 * triangles) return;
    this.topology = topology;
  }

  /** Takes a frame; false when its topology is not here (yet). */
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

  /** Brings positions and normals to the GPU if a new frame came since the last picture. */
  upload(): void {
    if (!this.stale || !this.render) return;
    this.stale = false;
    this.marks.upload();
    this.rims.follow(this.render.rims, this.positions);
    this.rims.upload();
    const position = this.geometry.getAttribute("position") as BufferAttribute;
    const normal = this.geometry.getAttribute("normal") as BufferAttribute;
    gather(this.positions, this.render.source, position.array as Float32Array, this.bounds);
    accumulateNormals(this.render, position.array as Float32Array, normal.array as Float32Array);
    for (const attribute of [position, normal]) {
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, 3 * this.render.source.length);
      attribute.needsUpdate = true;
    }
  }

  dispose(): void {
    this.object.removeFromParent();
    this.geometry.dispose();
    this.marks.dispose();
    this.rims.dispose();
  }

  private adopt(topology: SurfaceTopology): boolean {
    const triangles = words(topology.triangles), tags = words(topology.tags);
    for (const v of triangles) if (v >= topology.vertexCount) return false;
    this.epoch = topology.epoch;
    this.vertexCount = topology.vertexCount;
    this.triangleCount = topology.triangleCount;
    this.render = smoothTopology(triangles, tags, this.positions, this.vertexCount);
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
    return true;
  }

  /** Buffers grow by half, so that a long cut does not make a new buffer at every epoch. */
  private reserve(vertices: number, indices: number): void {
    const position = this.geometry.getAttribute("position") as BufferAttribute | undefined;
    if (!position || position.count < vertices) {
      const room = Math.ceil(vertices * 1.5);
      if (position) this.geometry.dispose();
      for (const name of ["position", "normal"]) {
        const attribute = new BufferAttribute(new Float32Array(3 * room), 3);
        this.geometry.setAttribute(name, attribute.setUsage(DynamicDrawUsage));
      }
    }
    if (!this.geometry.index || this.geometry.index.count < indices) {
      const room = Math.ceil(indices * 1.5);
      this.geometry.setIndex(new BufferAttribute(new Uint32Array(room), 1).setUsage(DynamicDrawUsage));
    }
  }
}

/** The message's own bytes as floats; copied into `room` only where they do not lie on four bytes. */
function floats(bytes: Uint8Array, room: Float32Array): Float32Array {
  if (bytes.byteOffset % 4 === 0) return new Float32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4);
  const out = room.length === bytes.length / 4 && room.byteOffset === 0 ? room : new Float32Array(bytes.length / 4);
  new Uint8Array(out.buffer, out.byteOffset, bytes.length).set(bytes);
  return out;
}

function words(bytes: Uint8Array): Uint32Array {
  return new Uint32Array(bytes.slice().buffer);
}

const low = new Vector3(), high = new Vector3();

function gather(from: Float32Array, source: Uint32Array, to: Float32Array, bounds: Box3): void {
  low.setScalar(Infinity);
  high.setScalar(-Infinity);
  for (let r = 0; r < source.length; r++) {
    const s = 3 * source[r], d = 3 * r;
    const x = from[s], y = from[s + 1], z = from[s + 2];
    to[d] = x; to[d + 1] = y; to[d + 2] = z;
    if (x < low.x) low.x = x;
    if (y < low.y) low.y = y;
    if (z < low.z) low.z = z;
    if (x > high.x) high.x = x;
    if (y > high.y) high.y = y;
    if (z > high.z) high.z = z;
  }
  bounds.set(low, high);
}

/** Area-weighted vertex normals; the shader normalises. */
function accumulateNormals(render: RenderTopology, x: Float32Array, n: Float32Array): void {
  n.fill(0, 0, 3 * render.source.length);
  const index = render.index;
  for (let c = 0; c < index.length; c += 3) {
    const i = 3 * index[c], j = 3 * index[c + 1], k = 3 * index[c + 2];
    const ux = x[j] - x[i], uy = x[j + 1] - x[i + 1], uz = x[j + 2] - x[i + 2];
    const vx = x[k] - x[i], vy = x[k + 1] - x[i + 1], vz = x[k + 2] - x[i + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    n[i] += nx; n[i + 1] += ny; n[i + 2] += nz;
    n[j] += nx; n[j + 1] += ny; n[j + 2] += nz;
    n[k] += nx; n[k + 1] += ny; n[k + 2] += nz;
  }
  for (let r = 0; r < 3 * render.source.length; r += 3) {
    const length = Math.hypot(n[r], n[r + 1], n[r + 2]);
    if (length > 0) { n[r] /= length; n[r + 1] /= length; n[r + 2] /= length; }
    else n[r + 2] = 1;
  }
}

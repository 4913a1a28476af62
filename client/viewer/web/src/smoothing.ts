// Decides which triangle corners share a normal: smooth over skin, sharp at the rim of a cut.

import { find, unite } from "./parts";

/** Neighbouring triangles of one kind share normals if the angle between them is below this. */
const CREASE_COS = Math.cos((52 * Math.PI) / 180);
/** Triangles below this fraction of the mean area have no reliable normal and never form a crease. */
const SLIVER = 0.02;

/** A surface ready for drawing. Corners that share a normal share a render vertex, except on the seams of an image. */
export interface RenderTopology {
  /** Three render vertices per triangle, skin triangles first. */
  index: Uint32Array;
  /** Surface vertex of every render vertex. */
  source: Uint32Array;
  /** First corner (of `index`) at every render vertex. */
  corner: Uint32Array;
  /** Render vertices on the seams of an image, each before the one that it shares its normal with. */
  seams: Uint32Array;
  /** Triangles with tag 0; the rest are lips of cuts. */
  skinTriangles: number;
  /** Tag of every triangle, in the order of `index`. */
  tags: Uint32Array;
  /** Edges between skin and lips: two surface vertices each. */
  rims: Uint32Array;
}

/**
 * Groups corners by union-find over edges. The two triangles of an edge are joined if they have the same tag
 * and meet below the crease angle at the given positions. A new slit is still closed there: its lips fold by
 * 180° at the front and stay apart.
 *
 * `image` holds u v of the three corners of every skin triangle, in their order, or nothing. Where an image does not go
 * on, corners share the normal, but not the render vertex.
 */
export function smoothTopology(
  given: Uint32Array, givenTags: Uint32Array, positions: Float32Array, vertexCount: number,
  image: Float32Array = new Float32Array(0),
): RenderTopology {
  const { triangles, tags, skinTriangles } = skinFirst(given, givenTags);
  const corners = triangles.length;
  const { start, list } = cornersOfVertices(triangles, vertexCount);
  const { normals, sliver } = faceNormals(triangles, positions);
  const parent = new Uint32Array(corners);
  for (let c = 0; c < corners; c++) parent[c] = c;
  const rims: number[] = [];

  for (let c = 0; c < corners; c++) {
    const t = (c / 3) | 0;
    const next = c % 3 === 2 ? c - 2 : c + 1;
    const a = triangles[c], b = triangles[next];
    for (let k = start[b]; k < start[b + 1]; k++) {
      const c2 = list[k];
      const next2 = c2 % 3 === 2 ? c2 - 2 : c2 + 1;
      if (triangles[next2] !== a) continue;
      const t2 = (c2 / 3) | 0;
      if (tags[t] === 0 && tags[t2] !== 0) rims.push(a, b);
      if (t < t2 && tags[t] === tags[t2] && isSmooth(normals, sliver, t, t2)) {
        unite(parent, c, next2);
        unite(parent, next, c2);
      }
      break;
    }
  }

  const index = new Uint32Array(corners);
  const first = new Int32Array(corners).fill(-1), next = new Int32Array(corners).fill(-1);
  const source = new Uint32Array(corners), corner = new Uint32Array(corners), seams: number[] = [];
  const onImage = (c: number) => 2 * c + 1 < image.length;
  const same = (c: number, d: number) =>
    !onImage(c) || (image[2 * c] === image[2 * d] && image[2 * c + 1] === image[2 * d + 1]);
  let count = 0;
  for (let c = 0; c < corners; c++) {
    const root = find(parent, c);
    let id = first[root], last = -1;
    while (id >= 0 && !same(c, corner[id])) [last, id] = [id, next[id]];
    if (id < 0) {
      id = count++;
      source[id] = triangles[c];
      corner[id] = c;
      if (last < 0) first[root] = id;
      else {
        next[last] = id;
        seams.push(id, first[root]);
      }
    }
    index[c] = id;
  }
  return {
    index, source: source.slice(0, count), corner: corner.slice(0, count), seams: Uint32Array.from(seams),
    skinTriangles, tags, rims: Uint32Array.from(rims),
  };
}

/** Stable partition into skin, then lips, so that each kind is one draw range. */
function skinFirst(given: Uint32Array, givenTags: Uint32Array) {
  const n = givenTags.length;
  let skinTriangles = 0;
  for (let t = 0; t < n; t++) if (givenTags[t] === 0) skinTriangles += 1;
  const triangles = new Uint32Array(3 * n);
  const tags = new Uint32Array(n);
  let skin = 0, lip = skinTriangles;
  for (let t = 0; t < n; t++) {
    const to = givenTags[t] === 0 ? skin++ : lip++;
    tags[to] = givenTags[t];
    triangles[3 * to] = given[3 * t];
    triangles[3 * to + 1] = given[3 * t + 1];
    triangles[3 * to + 2] = given[3 * t + 2];
  }
  return { triangles, tags, skinTriangles };
}

/** Corners around every vertex, as compressed rows. */
function cornersOfVertices(triangles: Uint32Array, vertexCount: number) {
  const start = new Uint32Array(vertexCount + 1);
  for (const v of triangles) start[v + 1] += 1;
  for (let v = 0; v < vertexCount; v++) start[v + 1] += start[v];
  const cursor = start.slice(0, vertexCount);
  const list = new Uint32Array(triangles.length);
  for (let c = 0; c < triangles.length; c++) list[cursor[triangles[c]]++] = c;
  return { start, list };
}

function faceNormals(triangles: Uint32Array, x: Float32Array) {
  const n = triangles.length / 3;
  const normals = new Float32Array(3 * n);
  const area = new Float32Array(n);
  let total = 0;
  for (let t = 0; t < n; t++) {
    const i = 3 * triangles[3 * t], j = 3 * triangles[3 * t + 1], k = 3 * triangles[3 * t + 2];
    const ux = x[j] - x[i], uy = x[j + 1] - x[i + 1], uz = x[j + 2] - x[i + 2];
    const vx = x[k] - x[i], vy = x[k + 1] - x[i + 1], vz = x[k + 2] - x[i + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    const length = Math.hypot(nx, ny, nz);
    area[t] = length;
    total += length;
    if (length > 0) {
      normals[3 * t] = nx / length;
      normals[3 * t + 1] = ny / length;
      normals[3 * t + 2] = nz / length;
    }
  }
  const least = (SLIVER * total) / Math.max(1, n);
  const sliver = new Uint8Array(n);
  for (let t = 0; t < n; t++) sliver[t] = area[t] < least ? 1 : 0;
  return { normals, sliver };
}

function isSmooth(n: Float32Array, sliver: Uint8Array, s: number, t: number): boolean {
  if (sliver[s] || sliver[t]) return true;
  const cos = n[3 * s] * n[3 * t] + n[3 * s + 1] * n[3 * t + 1] + n[3 * s + 2] * n[3 * t + 2];
  return cos > CREASE_COS;
}

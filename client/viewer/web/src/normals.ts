// Positions and normals for the GPU, from the received surface.

import { Box3, Vector3 } from "three";
import type { RenderTopology } from "./smoothing";

const low = new Vector3(), high = new Vector3();

/** Copies positions to render vertices. `bounds` covers all of them, `core` those marked by `inCore`. */
export function gather(
  from: Float32Array, source: Uint32Array, to: Float32Array, bounds: Box3, inCore: Uint8Array | null, core: Box3,
): void {
  bounds.makeEmpty();
  low.setScalar(Infinity);
  high.setScalar(-Infinity);
  const coreLow = inCore ? new Vector3(Infinity, Infinity, Infinity) : low, coreHigh = inCore ? new Vector3(-Infinity, -Infinity, -Infinity) : high;
  for (let r = 0; r < source.length; r++) {
    const s = 3 * source[r], d = 3 * r;
    const x = from[s], y = from[s + 1], z = from[s + 2];
    to[d] = x; to[d + 1] = y; to[d + 2] = z;
    widen(low, high, x, y, z);
    if (inCore && inCore[source[r]]) widen(coreLow, coreHigh, x, y, z);
  }
  bounds.set(low, high);
  core.set(coreLow, coreHigh);
}

function widen(low: Vector3, high: Vector3, x: number, y: number, z: number): void {
  if (x < low.x) low.x = x;
  if (y < low.y) low.y = y;
  if (z < low.z) low.z = z;
  if (x > high.x) high.x = x;
  if (y > high.y) high.y = y;
  if (z > high.z) high.z = z;
}

/** Area-weighted vertex normals. */
export function accumulateNormals(render: RenderTopology, x: Float32Array, n: Float32Array): void {
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
  const { seams } = render;
  for (let s = 0; s < seams.length; s += 2) {
    const from = 3 * seams[s], to = 3 * seams[s + 1];
    n[to] += n[from]; n[to + 1] += n[from + 1]; n[to + 2] += n[from + 2];
  }
  for (let s = 0; s < seams.length; s += 2) {
    const to = 3 * seams[s];
    n.copyWithin(to, 3 * seams[s + 1], 3 * seams[s + 1] + 3);
  }
  for (let r = 0; r < 3 * render.source.length; r += 3) {
    const length = Math.hypot(n[r], n[r + 1], n[r + 2]);
    if (length > 0) { n[r] /= length; n[r + 1] /= length; n[r + 2] /= length; }
    else n[r + 2] = 1;
  }
}

// Intersection of a ray with the surfaces: plain Möller-Trumbore over the arrays that were drawn.

import { Vector3, type Ray } from "three";
import type { BodySurface } from "./body";

export interface Hit {
  body: BodySurface;
  distance: number;
  point: Vector3;
  /** Outward unit normal of the triangle. */
  normal: Vector3;
  /** 0 = skin. */
  tag: number;
}

/** The nearest front face along the ray, or null. */
export function pick(ray: Ray, bodies: Iterable<BodySurface>): Hit | null {
  let best: Hit | null = null;
  for (const body of bodies) {
    if (!body.render || !ray.intersectsBox(body.bounds)) continue;
    const hit = pickBody(ray, body, best?.distance ?? Infinity);
    if (hit) best = hit;
  }
  return best;
}

function pickBody(ray: Ray, body: BodySurface, nearer: number): Hit | null {
  const { index, source, tags } = body.render!;
  const x = body.positions;
  const { x: ox, y: oy, z: oz } = ray.origin;
  const { x: dx, y: dy, z: dz } = ray.direction;
  let best = -1, distance = nearer;
  for (let c = 0; c < index.length; c += 3) {
    const i = 3 * source[index[c]], j = 3 * source[index[c + 1]], k = 3 * source[index[c + 2]];
    const ax = x[i], ay = x[i + 1], az = x[i + 2];
    const ux = x[j] - ax, uy = x[j + 1] - ay, uz = x[j + 2] - az;
    const vx = x[k] - ax, vy = x[k + 1] - ay, vz = x[k + 2] - az;
    const px = dy * vz - dz * vy, py = dz * vx - dx * vz, pz = dx * vy - dy * vx;
    const det = ux * px + uy * py + uz * pz;
    if (det <= 0) continue;
    const sx = ox - ax, sy = oy - ay, sz = oz - az;
    const a = sx * px + sy * py + sz * pz;
    if (a < 0 || a > det) continue;
    const qx = sy * uz - sz * uy, qy = sz * ux - sx * uz, qz = sx * uy - sy * ux;
    const b = dx * qx + dy * qy + dz * qz;
    if (b < 0 || a + b > det) continue;
    const t = (vx * qx + vy * qy + vz * qz) / det;
    if (t > 0 && t < distance) {
      distance = t;
      best = c;
    }
  }
  if (best < 0) return null;
  const corner = (n: number) => new Vector3().fromArray(x, 3 * source[index[best + n]]);
  const a = corner(0);
  const normal = corner(1).sub(a).cross(corner(2).sub(a)).normalize();
  return { body, distance, point: ray.at(distance, new Vector3()), normal, tag: tags[best / 3] };
}

// Intersection of a ray with the surfaces: plain Möller-Trumbore over the arrays that were drawn.

import { Triangle, Vector2, Vector3, type Camera, type Ray } from "three";
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

/** The point of the picture nearest to `wanted` where a surface is seen, both from −1 to 1; null if none is in view. */
export function nearest(wanted: Vector2, camera: Camera, bodies: Iterable<BodySurface>): Vector2 | null {
  const best = new Vector2(), triangle = new Triangle(), middle = new Vector3(), normal = new Vector3();
  let distance = Infinity;
  for (const { render, positions } of bodies) {
    if (!render) continue;
    const at = (corner: number, to: Vector3) => to.fromArray(positions, 3 * render.source[render.index[corner]]);
    for (let c = 0; c < render.index.length; c += 3) {
      triangle.set(at(c, triangle.a), at(c + 1, triangle.b), at(c + 2, triangle.c));
      triangle.getMidpoint(middle);
      if (triangle.getNormal(normal).dot(camera.position) <= normal.dot(middle)) continue;
      const { x, y, z } = middle.project(camera);
      const away = Math.hypot(x - wanted.x, y - wanted.y);
      if (away >= distance || Math.abs(x) > 1 || Math.abs(y) > 1 || Math.abs(z) > 1) continue;
      distance = away;
      best.set(x, y);
    }
  }
  return distance < Infinity ? best : null;
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

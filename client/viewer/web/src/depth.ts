// Rest depth of wound faces below the skin.
//
// Cuts do not change the rest position of the outer skin. Its triangles are therefore put into a grid once.
// Each point of a wound is measured once, however often the topology changes.

import { Vector3, Triangle, Box3 } from "three";

/** Number of cells along the longest side. */
const CELLS = 24;

export class SkinDepth {
  private readonly cells = new Map<number, number[]>();
  private readonly known = new Map<string, number>();
  private readonly origin = new Vector3();
  private readonly triangles: Float32Array;
  private size = 1;

  /** Builds the grid of a skin: three corners per triangle, and rest positions of the vertices [m]. */
  constructor(corners: Uint32Array, rest: Float32Array) {
    this.triangles = new Float32Array(3 * corners.length);
    corners.forEach((v, c) => this.triangles.set(rest.subarray(3 * v, 3 * v + 3), 3 * c));
    const box = new Box3().setFromArray(this.triangles as unknown as number[]);
    this.origin.copy(box.min);
    const extent = box.getSize(new Vector3());
    this.size = Math.max(1e-9, Math.max(extent.x, extent.y, extent.z) / CELLS);
    for (let t = 0; t < this.triangles.length; t += 9) this.enter(t);
  }

  /** Distance of a rest position from the skin [m]. */
  at(x: number, y: number, z: number): number {
    const key = `${x},${y},${z}`;
    let depth = this.known.get(key);
    if (depth === undefined) {
      depth = this.measure(point.set(x, y, z));
      this.known.set(key, depth);
    }
    return depth;
  }

  private enter(t: number): void {
    const x = this.triangles;
    const low = [0, 0, 0], high = [0, 0, 0];
    for (let axis = 0; axis < 3; axis++) {
      const o = this.origin.getComponent(axis);
      low[axis] = Math.floor((Math.min(x[t + axis], x[t + 3 + axis], x[t + 6 + axis]) - o) / this.size);
      high[axis] = Math.floor((Math.max(x[t + axis], x[t + 3 + axis], x[t + 6 + axis]) - o) / this.size);
    }
    for (let i = low[0]; i <= high[0]; i++)
      for (let j = low[1]; j <= high[1]; j++)
        for (let k = low[2]; k <= high[2]; k++) {
          const key = cellKey(i, j, k);
          const cell = this.cells.get(key);
          if (cell) cell.push(t);
          else this.cells.set(key, [t]);
        }
  }

  /** Searches shells of cells around the point until no cell further out can be nearer. */
  private measure(p: Vector3): number {
    const at = [p.x - this.origin.x, p.y - this.origin.y, p.z - this.origin.z].map((c) => Math.floor(c / this.size));
    let best = Infinity;
    for (let ring = 0; ring <= CELLS + 1 && best > (ring - 1) * this.size; ring++) {
      for (let i = -ring; i <= ring; i++)
        for (let j = -ring; j <= ring; j++) {
          const inner = Math.max(Math.abs(i), Math.abs(j)) < ring;
          for (let k = -ring; k <= ring; k += inner && ring > 0 ? 2 * ring : 1) {
            for (const t of this.cells.get(cellKey(at[0] + i, at[1] + j, at[2] + k)) ?? []) best = Math.min(best, this.distance(p, t));
          }
        }
    }
    return Number.isFinite(best) ? best : 0;
  }

  private distance(p: Vector3, t: number): number {
    triangle.a.fromArray(this.triangles, t);
    triangle.b.fromArray(this.triangles, t + 3);
    triangle.c.fromArray(this.triangles, t + 6);
    return triangle.closestPointToPoint(p, near).distanceTo(p);
  }
}

const point = new Vector3(), near = new Vector3(), triangle = new Triangle();

function cellKey(i: number, j: number, k: number): number {
  return ((i + 512) * 1024 + (j + 512)) * 1024 + (k + 512);
}

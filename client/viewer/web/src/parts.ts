// Connected parts of a surface: sets of vertices joined by triangles.

export interface Parts {
  /** Part of every vertex, numbered by falling area. Vertices without a triangle belong to the last part. */
  of: Uint32Array;
  /** Area of every part at the given positions [m²], descending. */
  area: number[];
}

export function partsOf(triangles: Uint32Array, vertexCount: number, x: Float32Array): Parts {
  const parent = new Uint32Array(vertexCount);
  for (let v = 0; v < vertexCount; v++) parent[v] = v;
  for (let c = 0; c < triangles.length; c += 3) {
    unite(parent, triangles[c], triangles[c + 1]);
    unite(parent, triangles[c], triangles[c + 2]);
  }
  const areas = new Map<number, number>();
  for (let c = 0; c < triangles.length; c += 3) {
    const root = find(parent, triangles[c]);
    areas.set(root, (areas.get(root) ?? 0) + triangleArea(x, triangles[c], triangles[c + 1], triangles[c + 2]));
  }
  const sorted = [...areas].sort((a, b) => b[1] - a[1]);
  const number = new Map(sorted.map(([root], i) => [root, i]));
  const of = new Uint32Array(vertexCount);
  for (let v = 0; v < vertexCount; v++) of[v] = number.get(find(parent, v)) ?? Math.max(0, sorted.length - 1);
  return { of, area: sorted.map(([, area]) => area) };
}

export function triangleArea(x: Float32Array, a: number, b: number, c: number): number {
  const i = 3 * a, j = 3 * b, k = 3 * c;
  const ux = x[j] - x[i], uy = x[j + 1] - x[i + 1], uz = x[j + 2] - x[i + 2];
  const vx = x[k] - x[i], vy = x[k + 1] - x[i + 1], vz = x[k + 2] - x[i + 2];
  return 0.5 * Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
}

export function find(parent: Uint32Array, c: number): number {
  while (parent[c] !== c) {
    parent[c] = parent[parent[c]];
    c = parent[c];
  }
  return c;
}

export function unite(parent: Uint32Array, a: number, b: number): void {
  const ra = find(parent, a), rb = find(parent, b);
  if (ra < rb) parent[rb] = ra;
  else parent[ra] = rb;
}

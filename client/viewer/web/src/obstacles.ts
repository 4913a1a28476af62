// Rigid things that stand still and that bodies touch: what physics knows, and nothing else.

import {
  BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, Color, DoubleSide, FrontSide, GridHelper, Group, Mesh,
  MeshStandardMaterial, PlaneGeometry, Quaternion, SphereGeometry, Vector3, type Object3D,
} from "three";
import type { ObstacleInfo } from "../gen/scindo/v1/server_pb";
import type { Stage } from "./stage";

const SURFACE = new MeshStandardMaterial({ color: 0x9aa4ad, roughness: 0.85, metalness: 0, side: DoubleSide });
/** Seen from behind, a plane hides nothing. */
const PLANE = new MeshStandardMaterial({ color: 0x9aa4ad, roughness: 0.9, metalness: 0, side: FrontSide });
/** A half-space is drawn as a square with this many radii of the scene to each side. */
const REACH = 4;
const LINES = 32;

export class Obstacles {
  private readonly group = new Group();
  private infos: ObstacleInfo[] = [];
  private radius = 0;

  constructor(private readonly stage: Stage) {
    this.group.name = "obstacles";
    stage.scene.add(this.group);
  }

  /** Number of obstacles that are drawn. */
  get count(): number {
    return this.group.children.length;
  }

  /** Takes over the obstacles of a scene. */
  take(infos: ObstacleInfo[]): void {
    this.infos = infos;
    this.radius = 0;
  }

  /** Draws them anew when the size of the scene has changed: a half-space has none of its own. */
  place(): void {
    const radius = this.stage.radius;
    if (this.radius > 0 && Math.abs(radius / this.radius - 1) < 0.5) return;
    this.radius = radius;
    for (const old of [...this.group.children]) dispose(old);
    this.group.clear();
    for (const info of this.infos) {
      const shape = shapeOf(info, radius, this.stage.center);
      if (shape) this.group.add(shape);
    }
  }
}

function dispose(object: Object3D): void {
  object.traverse((part) => (part as Mesh).geometry?.dispose());
}

function vector(v: { x: number; y: number; z: number } | undefined): Vector3 {
  return new Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);
}

function shapeOf({ shape }: ObstacleInfo, radius: number, center: Vector3): Object3D | null {
  switch (shape.case) {
    case "halfSpace": return plane(vector(shape.value.pointM), vector(shape.value.normal), radius, center);
    case "box": {
      const min = vector(shape.value.minM), max = vector(shape.value.maxM);
      const size = max.clone().sub(min);
      return solid(new BoxGeometry(size.x, size.y, size.z), min.add(max).multiplyScalar(0.5));
    }
    case "capsule": {
      const { radiusM } = shape.value, from = vector(shape.value.fromM), to = vector(shape.value.toM);
      const axis = to.clone().sub(from), length = axis.length();
      if (length < 1e-9) return solid(new SphereGeometry(radiusM, 48, 32), from);
      const mesh = solid(new CapsuleGeometry(radiusM, length, 12, 32), from.add(to).multiplyScalar(0.5));
      mesh.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), axis.normalize());
      return mesh;
    }
    case "surface": {
      const { positions, triangles } = shape.value;
      if (triangles.length === 0) return null;
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions.slice().buffer), 3));
      geometry.setIndex(new BufferAttribute(new Uint32Array(triangles.slice().buffer), 1));
      geometry.computeVertexNormals();
      return solid(geometry, new Vector3());
    }
    default: return null;
  }
}

function solid(geometry: BufferGeometry, at: Vector3): Mesh {
  const mesh = new Mesh(geometry, SURFACE);
  mesh.position.copy(at);
  mesh.receiveShadow = true;
  mesh.castShadow = true;
  return mesh;
}

/** A square of the plane below the scene, with lines that show how it lies. */
function plane(point: Vector3, normal: Vector3, radius: number, center: Vector3): Object3D {
  const n = normal.normalize();
  const group = new Group();
  // The foot of the scene's centre on the plane.
  group.position.copy(center).addScaledVector(n, n.dot(point.clone().sub(center)));
  const size = 2 * REACH * radius;
  const face = new Mesh(new PlaneGeometry(size, size), PLANE);
  face.quaternion.copy(new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), n));
  face.receiveShadow = true;
  const lines = new GridHelper(size, LINES, new Color(0x78828c), new Color(0x8a949d));
  lines.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), n);
  lines.position.copy(n).multiplyScalar(2e-3 * radius);
  group.add(face, lines);
  return group;
}

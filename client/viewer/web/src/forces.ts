// Forces of contact: an arrow at each point, and the total on each body in the panel.

import {
  ConeGeometry, CylinderGeometry, DynamicDrawUsage, Group, InstancedMesh, Matrix4, MeshBasicMaterial, Quaternion, Vector3,
  type BufferGeometry,
} from "three";
import { ForcePair_Kind, type ForcePair, type Forces as Message } from "../gen/scindo/v1/force_pb";
import { element, setRows, type Row } from "./dom";
import type { Stage } from "./stage";
import { engineering, length } from "./units";

/** Most arrows: all points that a message may hold. */
const MOST = 64 * 32;
const UP = new Vector3(0, 0, 1);
/** Length of the longest arrow, relative to the radius of the stage. */
const LONGEST = 0.35;
/** An arrow shorter than this part of the longest is not drawn. */
const LEAST = 0.02;

export class Forces {
  on = false;
  private readonly object = new Group();
  private readonly shaft = parts(new CylinderGeometry(0.006, 0.006, 0.8, 8).rotateX(Math.PI / 2).translate(0, 0, 0.4));
  private readonly head = parts(new ConeGeometry(0.018, 0.2, 12).rotateX(Math.PI / 2).translate(0, 0, 0.9));
  private readonly rows = element("div", "rows");
  private readonly box = document.getElementById("forces")!;
  private message: Message | null = null;
  /** The largest force of a point lately [N], to which arrows are scaled. */
  private scaleN = 0;

  constructor(private readonly stage: Stage) {
    this.object.add(this.shaft, this.head);
    this.object.visible = false;
    stage.scene.add(this.object);
    this.box.append(this.rows);
  }

  show(on: boolean): void {
    this.on = on;
    this.box.hidden = !on;
    this.restart();
  }

  /** Forgets what belongs to another scene. */
  restart(): void {
    this.message = null;
    this.scaleN = 0;
    this.object.visible = false;
    setRows(this.rows, [["none", ""]]);
    this.stage.invalidate();
  }

  take(message: Message): void {
    if (!this.on) return;
    this.message = message;
    const largest = Math.max(0, ...message.pairs.flatMap((pair) => pair.points.map((point) => Math.hypot(...forceOf(point)))));
    // Slowly down and at once up, so that arrows neither leave the picture nor flicker.
    this.scaleN = Math.max(largest, 0.98 * this.scaleN);
    setRows(this.rows, message.pairs.length > 0 ? message.pairs.map(row) : [["none", ""]]);
    this.stage.invalidate();
  }

  /** Called once per picture: puts the arrows of the newest message in place. */
  place(): void {
    let count = 0;
    const thick = this.stage.radius, longest = LONGEST * this.stage.radius;
    for (const point of this.message?.pairs.flatMap((pair) => pair.points) ?? []) {
      const at = point.pointM;
      force.set(...forceOf(point));
      const newtons = force.length();
      const part = this.scaleN > 0 ? newtons / this.scaleN : 0;
      if (!at || part < LEAST || count === MOST) continue;
      turn.setFromUnitVectors(UP, force.divideScalar(newtons));
      // The tip touches the point: the arrow pushes.
      from.set(at.x, at.y, at.z).addScaledVector(force, -part * longest);
      matrix.compose(from, turn, size.set(thick, thick, part * longest));
      this.shaft.setMatrixAt(count, matrix);
      this.head.setMatrixAt(count, matrix);
      count += 1;
    }
    for (const mesh of [this.shaft, this.head]) {
      mesh.count = count;
      mesh.instanceMatrix.needsUpdate = true;
    }
    this.object.visible = count > 0;
  }

  /** For tests. */
  get shown(): { pairs: number; arrows: number; time: number } {
    return { pairs: this.message?.pairs.length ?? 0, arrows: this.object.visible ? this.shaft.count : 0, time: this.message?.simTimeS ?? -1 };
  }
}

const from = new Vector3(), force = new Vector3(), size = new Vector3(), turn = new Quaternion(), matrix = new Matrix4();

/** All contact forces on each body together [N]. A pair of bodies counts on both, a body on itself on none. */
export function totals(pairs: readonly ForcePair[]): Map<string, [number, number, number]> {
  const sums = new Map<string, [number, number, number]>();
  const add = (id: string, sign: number, f: ForcePair["forceN"]) => {
    const sum = sums.get(id) ?? [0, 0, 0];
    sums.set(id, [sum[0] + sign * (f?.x ?? 0), sum[1] + sign * (f?.y ?? 0), sum[2] + sign * (f?.z ?? 0)]);
  };
  for (const pair of pairs) {
    if (pair.kind === ForcePair_Kind.SELF) continue;
    add(pair.on, 1, pair.forceN);
    if (pair.kind === ForcePair_Kind.BODY) add(pair.by, -1, pair.forceN);
  }
  return sums;
}

function forceOf({ normal: n, normalN, tangentialN: t }: ForcePair["points"][number]): [number, number, number] {
  return [normalN * (n?.x ?? 0) + (t?.x ?? 0), normalN * (n?.y ?? 0) + (t?.y ?? 0), normalN * (n?.z ?? 0) + (t?.z ?? 0)];
}

function row(pair: ForcePair): Row {
  const f = pair.forceN;
  const size = engineering(pair.kind === ForcePair_Kind.SELF ? pair.normalN : Math.hypot(f?.x ?? 0, f?.y ?? 0, f?.z ?? 0), "N");
  const name = pair.kind === ForcePair_Kind.SELF ? `${pair.on} on itself` : `${pair.by} on ${pair.on}`;
  const points = `${pair.contacts} ${pair.contacts === 1 ? "point" : "points"}, up to ${length(pair.deepestM)} deep`;
  return [name, size, "", points];
}

function parts(geometry: BufferGeometry): InstancedMesh {
  // A force must be readable, so tissue in front does not hide it.
  const material = new MeshBasicMaterial({ color: 0xff8a5c, toneMapped: false, depthTest: false, transparent: true, opacity: 0.9 });
  const mesh = new InstancedMesh(geometry, material, MOST);
  mesh.instanceMatrix.setUsage(DynamicDrawUsage);
  mesh.frustumCulled = false;
  mesh.renderOrder = 5;
  mesh.count = 0;
  return mesh;
}

// A rigid tool as the server sees it: solid where the tissue lets it be, and a ghost where the hand holds it.

import {
  BufferAttribute, BufferGeometry, CapsuleGeometry, ConeGeometry, CylinderGeometry, Float32BufferAttribute, Group, Line,
  LineBasicMaterial, Mesh, MeshBasicMaterial, MeshStandardMaterial, Quaternion, SphereGeometry, Vector3, type Material,
} from "three";
import type { Stage } from "./stage";
import { ToolSample_Mode, type ToolShape, type ToolState } from "../gen/scindo/v1/tool_pb";
import type { Pose } from "../gen/scindo/v1/common_pb";

/** Below this force there is neither arrow nor label [N]. */
const QUIET_N = 0.005;
const UP = new Vector3(0, 0, 1);

const STEEL = new MeshStandardMaterial({ color: 0xb9c2cc, roughness: 0.34, metalness: 0.35 });
const HAND = new MeshStandardMaterial({ color: 0x5a9ae6, roughness: 0.4, metalness: 0.1 });
const GHOST = new MeshBasicMaterial({ color: 0x9fd0ff, transparent: true, opacity: 0.24, depthWrite: false });
// A force must be readable, so tissue in front does not hide it.
const ARROW = new MeshBasicMaterial({ color: 0xffd35c, toneMapped: false, depthTest: false, transparent: true });

/** The line from the hand to the tissue in its grip. */
const LEASH = new LineBasicMaterial({ color: 0x9fd0ff, toneMapped: false, depthTest: false, transparent: true, opacity: 0.95 });
/** A force above this fraction of its limit counts as limited. */
const AT_LIMIT = 0.985;

export class ToolVisual {
  readonly object = new Group();
  state: ToolState | null = null;
  readonly force = new Vector3();
  private readonly solid = new Group();
  private readonly ghost = new Group();
  private readonly arrow = arrow();
  private readonly leash = new Line(new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(6), 3)), LEASH);
  private readonly label = document.createElement("div");
  private readonly tag = document.createElement("div");
  private shapeKey = "";
  /** Who else holds the tool; empty: nobody, or this page. */
  holder = "";
  private colour = "";

  constructor(readonly id: string, readonly own: boolean) {
    this.object.add(this.solid, this.ghost, this.arrow, this.leash);
    this.leash.frustumCulled = this.leash.visible = false;
    this.leash.renderOrder = 5;
    this.tag.className = "holder";
    this.tag.hidden = true;
    document.getElementById("labels")!.append(this.label, this.tag);
  }

  /** Names and colours the tool of somebody else. */
  setHolder(name: string, colour: string): void {
    if (name === this.holder && colour === this.colour) return;
    this.holder = name;
    this.tag.textContent = name;
    this.tag.style.setProperty("--of", colour || "transparent");
    if (colour === this.colour) return;
    this.colour = colour;
    this.shapeKey = "";
    if (this.state) this.update(this.state);
  }

  update(state: ToolState): void {
    this.state = state;
    const f = state.forceN;
    this.force.set(f?.x ?? 0, f?.y ?? 0, f?.z ?? 0);
    const key = JSON.stringify([state.shape?.kind ?? null, Math.round(200 * state.closed)]);
    if (key === this.shapeKey || !state.shape) return;
    this.shapeKey = key;
    this.solid.clear();
    this.ghost.clear();
    // The page's own blade points at the viewer, and its handle would hide the cut.
    const shaft = !(this.own && state.shape.kind.case === "blade");
    this.solid.add(...parts(state.shape, this.own ? HAND : this.colour ? tinted(this.colour) : STEEL, shaft, state.closed));
    this.ghost.add(...parts(state.shape, GHOST, false, state.closed));
  }

  /** Moves solid, ghost, arrow and label to the newest state. */
  place(stage: Stage): void {
    const state = this.state;
    if (!state?.pose) return;
    setPose(this.solid, state.proxyPose ?? state.pose);
    setPose(this.ghost, state.pose);
    const apart = this.solid.position.distanceTo(this.ghost.position);
    this.ghost.visible = apart > 0.004 * stage.radius;
    this.placeLeash(state);
    this.placeTag(stage);
    const newtons = this.force.length();
    this.arrow.visible = newtons > QUIET_N;
    this.label.hidden = newtons <= QUIET_N;
    if (!this.arrow.visible) return;
    // The length grows with the force but stays within the picture: half of the full length at 2 N.
    const length = (0.9 * stage.radius * newtons) / (newtons + 2) + 0.08 * stage.radius;
    this.arrow.position.copy(this.solid.position);
    this.arrow.quaternion.setFromUnitVectors(UP, this.force.clone().divideScalar(newtons));
    this.arrow.scale.set(stage.radius, stage.radius, length);
    const head = this.force.clone().multiplyScalar(length / newtons).add(this.solid.position);
    const at = stage.project(head);
    this.label.hidden = !at.visible;
    this.label.style.transform = `translate(${(at.x + 10).toFixed(0)}px, ${(at.y - 12).toFixed(0)}px)`;
    const limited = this.isLimited;
    const text = `${newtons.toFixed(newtons < 1 ? 2 : 1)} N${limited ? " · at its limit" : ""}`;
    this.label.classList.toggle("limit", limited);
    if (this.label.textContent !== text) this.label.textContent = text;
  }

  /** Whether the limit holds the force back. */
  get isLimited(): boolean {
    const limit = this.state?.maxForceN ?? 0;
    return limit > 0 && this.force.length() >= AT_LIMIT * limit;
  }

  /** Position of the tissue that the tool holds, or null. */
  get heldPoint(): Vector3 | null {
    const at = this.state?.heldPointM;
    return at ? new Vector3(at.x, at.y, at.z) : null;
  }

  private placeTag(stage: Stage): void {
    const at = this.holder ? stage.project(this.solid.position) : null;
    this.tag.hidden = !at?.visible;
    if (at?.visible) this.tag.style.transform = `translate(${(at.x + 10).toFixed(0)}px, ${(at.y + 8).toFixed(0)}px)`;
  }

  private placeLeash(state: ToolState): void {
    const to = this.heldPoint, from = state.pose?.positionM;
    this.leash.visible = to !== null && from !== undefined;
    if (!to || !from) return;
    const position = this.leash.geometry.getAttribute("position") as BufferAttribute;
    position.setXYZ(0, from.x, from.y, from.z);
    position.setXYZ(1, to.x, to.y, to.z);
    position.needsUpdate = true;
  }

  dispose(): void {
    this.object.removeFromParent();
    this.leash.geometry.dispose();
    this.label.remove();
    this.tag.remove();
  }
}

const tints = new Map<string, MeshStandardMaterial>();

/** Steel in the colour of a person. */
function tinted(colour: string): MeshStandardMaterial {
  let material = tints.get(colour);
  if (!material) {
    material = new MeshStandardMaterial({ color: colour, roughness: 0.4, metalness: 0.15 });
    tints.set(colour, material);
  }
  return material;
}

export function modeName(mode: ToolSample_Mode): string {
  return ["", "hover", "touch", "grab", "cut", "scalpel"][mode] ?? "";
}

/** Meshes of a shape in tool axes: tip at the origin, shaft along +z. The jaws of forceps are `closed` from 0 to 1. */
export function parts(shape: ToolShape, material: Material, shaft: boolean, closed = 0): Mesh[] {
  const kind = shape.kind;
  switch (kind.case) {
    case "sphere": {
      const r = kind.value.radiusM;
      const ball = new Mesh(new SphereGeometry(r, 32, 20), material);
      return shaft ? solid([ball, rod(0.24 * r, r * 0.8, 8 * r, material)]) : [ball];
    }
    case "capsule": {
      const { radiusM: r, lengthM: l } = kind.value;
      const body = new Mesh(new CapsuleGeometry(r, l, 8, 24), material);
      body.rotation.x = Math.PI / 2;
      body.position.z = l / 2;
      return shaft ? solid([body]) : [body];
    }
    case "blade": {
      const l = kind.value.lengthM;
      const edge = new Mesh(bladeGeometry(l), material);
      return shaft ? solid([edge, rod(0.055 * l, l * 1.02, 2.6 * l, material)]) : [edge];
    }
    case "forceps": {
      const { radiusM: r, lengthM: l, openingM } = kind.value;
      const apart = 0.5 * openingM * (1 - closed) + r;
      const jaws = [apart, -apart].map((x) => capsule([x, 0, 0], [Math.sign(x) * r, 0, l], r, material));
      return shaft ? solid([...jaws, rod(1.8 * r, l, 1.6 * l, material)]) : jaws;
    }
    case "retractor": {
      const { radiusM: r, lengthM: l, widthM: w, heightM: h } = kind.value;
      const bars = [0, h].map((z) => capsule([-w / 2, 0, z], [w / 2, 0, z], r, material));
      return solid([...bars, capsule([0, 0, 0], [0, 0, l], r, material)]);
    }
    case "hook": {
      const { radiusM: r, lengthM: l, reachM: x, pointM: z } = kind.value;
      const ends: [Triple, Triple][] = [[[0, 0, 0], [0, 0, l]], [[0, 0, 0], [x, 0, 0]], [[x, 0, 0], [x, 0, z]]];
      return solid(ends.map(([from, to]) => capsule(from, to, r, material)));
    }
    default: return [];
  }
}

type Triple = [number, number, number];

function capsule(from: Triple, to: Triple, radius: number, material: Material): Mesh {
  const a = new Vector3(...from), along = new Vector3(...to).sub(a);
  const mesh = new Mesh(new CapsuleGeometry(radius, along.length(), 8, 20), material);
  mesh.position.copy(a).addScaledVector(along, 0.5);
  mesh.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), along.normalize());
  return mesh;
}

function solid(meshes: Mesh[]): Mesh[] {
  for (const mesh of meshes) mesh.castShadow = true;
  return meshes;
}

function rod(radius: number, from: number, to: number, material: Material): Mesh {
  const mesh = new Mesh(new CylinderGeometry(radius, radius, to - from, 20), material);
  mesh.rotation.x = Math.PI / 2;
  mesh.position.z = (from + to) / 2;
  return mesh;
}

/**
 * A thin double wedge along +z. The belly narrows to the tip. It is symmetric, because the edge may lead
 * either way.
 */
function bladeGeometry(length: number): BufferGeometry {
  const w = 0.085 * length, t = 0.012 * length;
  const rings = [[0, 0.02], [0.12, 0.55], [0.3, 0.9], [0.55, 1], [1, 0.8], [1.03, 0.5]];
  const position: number[] = [], index: number[] = [];
  for (const [z, s] of rings) position.push(w * s, 0, z * length, 0, t * s, z * length, -w * s, 0, z * length, 0, -t * s, z * length);
  for (let r = 0; r + 1 < rings.length; r++) {
    for (let k = 0; k < 4; k++) {
      const a = 4 * r + k, b = 4 * r + ((k + 1) % 4);
      index.push(a, b, b + 4, a, b + 4, a + 4);
    }
  }
  const last = 4 * (rings.length - 1);
  index.push(0, 2, 1, 0, 3, 2, last, last + 1, last + 2, last, last + 2, last + 3);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(position, 3));
  geometry.setIndex(index);
  const flat = geometry.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
}

/** A unit arrow along +z. z is scaled to the length, x and y to the scene. */
function arrow(): Group {
  const shaft = new Mesh(new CylinderGeometry(0.009, 0.009, 0.8, 12), ARROW);
  shaft.rotation.x = Math.PI / 2;
  shaft.position.z = 0.4;
  const head = new Mesh(new ConeGeometry(0.028, 0.22, 16), ARROW);
  head.rotation.x = Math.PI / 2;
  head.position.z = 0.89;
  shaft.renderOrder = head.renderOrder = 5;
  const group = new Group();
  group.add(shaft, head);
  group.visible = false;
  return group;
}

const q = new Quaternion();

function setPose(object: Group, pose: Pose): void {
  const p = pose.positionM;
  object.position.set(p?.x ?? 0, p?.y ?? 0, p?.z ?? 0);
  q.set(pose.qx, pose.qy, pose.qz, pose.qw);
  if (q.lengthSq() > 0.5) object.quaternion.copy(q.normalize());
}

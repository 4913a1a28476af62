// The mouse, a finger or the keyboard as a hand: it hovers over the tissue, presses, holds and cuts it. Forceps close while the button is down.
// Jaws that are kept closed hold on without it, and the next drag moves them.
//
// A press defines a plane through the touched point, parallel to the picture. Poke and grab move in that
// plane, so that yielding tissue does not pull the tool along. A blade follows the skin under the cursor and
// points along the line of sight, so the cut runs where the user draws it.

import { Group, Matrix4, Mesh, MeshBasicMaterial, Plane, Quaternion, Raycaster, TorusGeometry, Vector2, Vector3 } from "three";
import { ToolSample_Mode, type ToolShape } from "../gen/scindo/v1/tool_pb";
import { PROBE, sampleOf, shapeOf, type Grip } from "./grip";
import { parts } from "./tool";
import { nearest, pick, type Hit } from "./pick";
import type { Relay } from "./relay";
import type { Stage } from "./stage";
import type { Session } from "./session";

export type HandMode = "orbit" | Grip;

/** Period of samples while the tool moves [ms]. At rest, a tenth of that rate keeps the tool alive. */
const SAMPLE_MS = 14;
const REST_MS = 120;
/** A press enters the tissue over this time [ms], as a hand does. */
const PRESS_MS = 140;
const GHOST = new MeshBasicMaterial({ color: 0x9fd0ff, transparent: true, opacity: 0.32, depthWrite: false });
const RING = new MeshBasicMaterial({ color: 0xd7ecff, transparent: true, opacity: 0.9, depthTest: false, toneMapped: false });

interface Press {
  /** The touched point, the picture plane through it, and the direction into the tissue. */
  anchor: Vector3;
  plane: Plane;
  inward: Vector3;
  since: number;
  /** Distance of the skin last seen under a blade, along the line of sight [m]. */
  reach: number;
  /** From the cursor to the tip of a tool that already held tissue when it was pressed [m]. */
  offset: Vector3 | null;
  /** Whether the tool has been sent from its full depth. */
  entered: boolean;
}

export class Hand {
  mode: HandMode = "orbit";
  /** Called when mode or depth change. */
  onChange: () => void = () => {};
  private readonly depth: Record<HandMode, number> = { orbit: 0, poke: 0.12, grab: 0, cut: 0.22, forceps: 0.04 };
  private readonly cursor = new Group();
  private readonly ring = new Mesh(new TorusGeometry(1, 0.07, 8, 40), RING);
  private readonly caster = new Raycaster();
  private readonly pointer = new Vector2();
  private inside = false;
  private pointerId = -1;
  private press: Press | null = null;
  private held = false;
  private kept = false;
  private roll = 0;
  private readonly tip = new Vector3();
  private readonly axis = new Vector3(0, 0, 1);
  private readonly quaternion = new Quaternion();
  private readonly lastTip = new Vector3();
  private readonly velocity = new Vector3();
  private lastSent = 0;
  private seq = 0n;
  private moved = false;
  private live = false;
  private shapeKey = "";

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly stage: Stage,
    private readonly session: Session,
    private readonly relay: Relay,
  ) {
    this.cursor.visible = false;
    stage.scene.add(this.cursor);
    const capture = { capture: true };
    canvas.addEventListener("pointerdown", (e) => this.onDown(e), capture);
    canvas.addEventListener("pointermove", (e) => this.onMove(e), capture);
    canvas.addEventListener("pointerup", (e) => this.onUp(e), capture);
    canvas.addEventListener("pointercancel", (e) => this.onUp(e), capture);
    canvas.addEventListener("pointerleave", () => { if (!this.press && !this.kept) this.leave(); });
    canvas.addEventListener("wheel", (e) => this.onWheel(e), { capture: true, passive: false });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  }

  /** Selects what the mouse does. A change of tool puts the old one away. */
  choose(mode: HandMode): void {
    if (mode === this.mode) return;
    this.drop();
    this.mode = mode;
    document.body.dataset["hand"] = mode;
    this.onChange();
    this.stage.invalidate();
  }

  /** Depth of the present tool below the skin [m]. */
  get depthM(): number {
    return this.depth[this.mode] * this.stage.radius;
  }

  /** Depth range as fractions of the scene's radius. A grab may also pull towards the viewer. */
  get depthRange(): { value: number; min: number; max: number } {
    const pulls = this.mode === "grab" || this.mode === "forceps";
    return { value: this.depth[this.mode], min: pulls ? -0.6 : 0, max: this.mode === "cut" ? 0.7 : 0.6 };
  }

  /** Whether the jaws of the forceps stay closed without the button. */
  get keepsClosed(): boolean {
    return this.kept;
  }

  /** Keeps the jaws of the forceps closed, or opens them again. */
  keepClosed(kept: boolean): void {
    this.kept = kept && this.mode === "forceps" && this.held;
    this.moved = true;
    this.onChange();
  }

  /** Turns the forceps about their shaft by an eighth. */
  turn(): void {
    if (this.mode !== "forceps") return;
    this.roll += Math.PI / 4;
    if (this.held) this.moveTo(this.tip, this.axis);
    this.moved = true;
    this.stage.invalidate();
  }

  setDepth(part: number): void {
    const { min, max } = this.depthRange;
    this.depth[this.mode] = Math.min(max, Math.max(min, part));
    this.moved = true;
    this.onChange();
  }

  /** Puts the tool away, so that the server releases it. */
  drop(): void {
    this.press = null;
    this.held = this.kept = false;
    this.stage.controls.enabled = true;
    if (this.live) this.relay.send({ case: "release", value: {} });
    this.live = false;
    this.leave();
  }

  /** Called once per picture: updates the tool and sends its pose if one is due. */
  advance(now: number): void {
    if (this.mode === "orbit" || this.session.readOnly) return;
    if (this.press) this.follow(now);
    else if (this.inside && this.moved && !this.kept) this.hover();
    const due = (this.moved && !this.kept) || this.press ? SAMPLE_MS : REST_MS;
    if (this.held && now - this.lastSent >= due) this.sendSample(now);
  }

  /** Moves the cursor to where the tool is held. */
  place(): void {
    // What the jaws hold apart is drawn as the server tells.
    this.cursor.visible = this.held && !(this.mode === "forceps" && this.live && (this.press !== null || this.kept));
    if (!this.cursor.visible) return;
    const shape = this.shape();
    const key = `${this.mode}${this.stage.radius}`;
    if (key !== this.shapeKey) {
      this.shapeKey = key;
      this.cursor.clear();
      this.cursor.add(...parts(shape, GHOST, false));
      this.ring.scale.setScalar(0.05 * this.stage.radius);
      if (this.mode === "cut") this.cursor.add(this.ring);
    }
    // The ring lies on the skin, the tip of the blade below it.
    this.ring.position.set(0, 0, this.press ? this.depthM : 0);
    this.cursor.position.copy(this.tip);
    this.cursor.quaternion.copy(this.quaternion);
  }

  /** The surface point under a point of the page. */
  surfaceAt(x: number, y: number): Hit | null {
    this.aim({ clientX: x, clientY: y });
    return this.hit();
  }

  private onDown(e: PointerEvent): void {
    this.canvas.focus({ preventScroll: true });
    this.aim(e);
    if (this.pointerId >= 0 && e.pointerId !== this.pointerId) {
      this.endPress(); // a second finger turns the view
      return;
    }
    if (e.button !== 0 || e.shiftKey || !this.begin()) return;
    this.pointerId = e.pointerId;
    this.canvas.setPointerCapture(e.pointerId);
  }

  /** Moves the tool across the picture, by parts of half its width and height. It appears in the middle of the bodies. */
  steer(across: number, up: number): void {
    if (this.mode === "orbit" || this.session.readOnly) return;
    if (this.held) this.pointer.set(clamp(this.pointer.x + across), clamp(this.pointer.y + up));
    else {
      const middle = this.stage.center.clone().project(this.stage.camera);
      this.pointer.set(middle.x, middle.y);
      if (!this.hit()) this.pointer.copy(nearest(this.pointer, this.stage.camera, this.session.bodies.values()) ?? this.pointer);
    }
    this.inside = true;
    this.moved = true;
    this.stage.invalidate();
  }

  /** Presses the tool where it is, or lifts it. */
  togglePress(): void {
    if (this.press) this.endPress();
    else if (this.held) this.begin();
    else this.steer(0, 0);
  }

  /** Begins a press under the pointer. False where there is nothing to press, or nothing to press it with. */
  private begin(): boolean {
    if (this.mode === "orbit" || this.session.readOnly) return false;
    const hit = this.hit();
    if (!hit && !this.kept) return false;
    this.stage.controls.enabled = false;
    const ray = this.caster.ray, facing = this.stage.camera.getWorldDirection(new Vector3());
    if (this.kept || !hit) {
      const plane = new Plane().setFromNormalAndCoplanarPoint(facing, this.tip);
      const offset = this.tip.clone().sub(ray.intersectPlane(plane, new Vector3()) ?? this.tip);
      this.press = { anchor: this.tip.clone(), plane, inward: this.axis.clone().negate(), since: -Infinity, reach: 0, offset, entered: true };
    } else {
      const along = { orbit: 1, poke: 0.35, grab: 1, cut: 1, forceps: 0.35 }[this.mode];
      this.press = {
        anchor: hit.point.clone(),
        plane: new Plane().setFromNormalAndCoplanarPoint(facing, hit.point),
        inward: hit.normal.clone().negate().lerp(ray.direction, along).normalize(),
        since: performance.now(),
        reach: hit.distance,
        offset: null,
        entered: false,
      };
    }
    this.held = true;
    this.follow(performance.now());
    this.sendSample(performance.now());
    return true;
  }

  private onMove(e: PointerEvent): void {
    if (this.pointerId >= 0 && e.pointerId !== this.pointerId) return;
    if (!this.press && e.buttons !== 0) return; // the view is being turned
    this.aim(e);
    this.inside = true;
    this.moved = true;
  }

  private onUp(e: PointerEvent): void {
    if (e.pointerId !== this.pointerId) return;
    this.endPress();
    if (e.pointerType === "touch") this.drop();
  }

  private onWheel(e: WheelEvent): void {
    if (this.mode === "orbit" || e.ctrlKey) return;
    this.aim(e);
    if (!this.press && !this.hit()) return;
    e.preventDefault();
    e.stopImmediatePropagation();
    this.setDepth(this.depth[this.mode] - Math.sign(e.deltaY) * 0.02);
  }

  private endPress(): void {
    if (this.pointerId >= 0 && this.canvas.hasPointerCapture(this.pointerId)) this.canvas.releasePointerCapture(this.pointerId);
    this.pointerId = -1;
    this.press = null;
    this.stage.controls.enabled = true;
    if (this.held) {
      if (!this.kept) this.hover();
      this.sendSample(performance.now());
    }
  }

  private leave(): void {
    this.inside = false;
    if (this.held && this.live) this.relay.send({ case: "release", value: {} });
    this.live = false;
    this.held = false;
    this.stage.invalidate();
  }

  private aim(e: { clientX: number; clientY: number }): void {
    const box = this.canvas.getBoundingClientRect();
    this.pointer.set(((e.clientX - box.left) / box.width) * 2 - 1, 1 - ((e.clientY - box.top) / box.height) * 2);
  }

  private hit(): Hit | null {
    this.caster.setFromCamera(this.pointer, this.stage.camera);
    return pick(this.caster.ray, this.session.bodies.values());
  }

  /** Moves a free tool just above the skin under the cursor. Beside the bodies there is no tool. */
  private hover(): void {
    this.moved = false;
    const hit = this.hit();
    if (!hit) {
      if (this.held) this.leave();
      this.inside = true;
      return;
    }
    const blade = this.mode === "cut";
    const away = blade ? this.caster.ray.direction.clone().negate() : hit.normal;
    const clearance = (blade ? 0.05 : PROBE * 1.5) * this.stage.radius;
    this.moveTo(hit.point.addScaledVector(away, clearance), away);
    this.held = true;
    this.stage.invalidate();
  }

  /** Moves a pressed tool in the plane of the press, or a blade along the skin. */
  private follow(now: number): void {
    const press = this.press!;
    this.caster.setFromCamera(this.pointer, this.stage.camera);
    const ray = this.caster.ray;
    const part = Math.min(1, (now - press.since) / PRESS_MS);
    const depth = this.depthM * part * (2 - part);
    if (this.mode === "cut") {
      const hit = this.hit();
      // Lips lie deeper than the skin beside them. The blade therefore keeps its distance over an open slit.
      if (hit && hit.tag === 0) press.reach += 0.5 * (hit.distance - press.reach);
      this.moveTo(ray.at(press.reach + depth, new Vector3()), ray.direction.clone().negate());
    } else {
      const point = ray.intersectPlane(press.plane, new Vector3()) ?? press.anchor.clone();
      const back = this.mode === "poke" ? PROBE * this.stage.radius : 0;
      if (press.offset) point.add(press.offset);
      else point.addScaledVector(press.inward, depth - back);
      this.moveTo(point, press.inward.clone().negate());
    }
    this.moved = false;
    this.stage.invalidate();
  }

  private moveTo(tip: Vector3, axis: Vector3): void {
    this.tip.copy(tip);
    this.axis.copy(axis).normalize();
    const side = this.stage.camera.up.clone().cross(this.axis);
    if (side.lengthSq() < 1e-6) side.set(1, 0, 0).cross(this.axis);
    side.normalize();
    if (this.mode === "forceps") side.applyAxisAngle(this.axis, this.roll);
    this.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(side, this.axis.clone().cross(side), this.axis));
  }

  private shape(): ToolShape {
    return shapeOf(this.mode === "orbit" ? "poke" : this.mode, this.stage.radius);
  }

  private sampleMode(): ToolSample_Mode {
    if (!this.press && !this.kept) return ToolSample_Mode.HOVER;
    if (this.mode === "grab" || this.mode === "forceps") return ToolSample_Mode.GRAB;
    return this.mode === "cut" ? ToolSample_Mode.CUT : ToolSample_Mode.TOUCH;
  }

  /** Jaws stay open on their way into the tissue, however few pictures the page draws: closed, they would glide off. */
  private jaws(): { closed?: number } {
    return this.mode === "forceps" && this.press && !this.press.entered ? { closed: 0 } : {};
  }

  private sendSample(now: number): void {
    const dt = (now - this.lastSent) / 1000;
    if (dt > 0 && dt < 0.2) this.velocity.copy(this.tip).sub(this.lastTip).divideScalar(dt);
    else this.velocity.setScalar(0);
    this.lastTip.copy(this.tip);
    this.lastSent = now;
    this.seq += 1n;
    const { seq, tip, velocity, quaternion: turn } = this;
    const value = sampleOf({ seq, now, tip, turn, velocity, mode: this.sampleMode(), shape: this.shape(), ...this.jaws() });
    if (this.press && now - this.press.since >= PRESS_MS) this.press.entered = true;
    const sent = this.relay.send({ case: "tool", value });
    this.live ||= sent;
  }
}

/** Keeps a coordinate within the picture. */
function clamp(part: number): number {
  return Math.min(1, Math.max(-1, part));
}

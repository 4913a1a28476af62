// Probes of the scene: their position, name and trace.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Group, Line, LineBasicMaterial, Points, PointsMaterial, Vector3 } from "three";
import { Color } from "three";
import type { Measures } from "../gen/scindo/v1/server_pb";
import type { Stage } from "./stage";
import { length } from "./units";

/** Most points of a trace: half a minute at twenty per second. */
const TRACE = 600;
const COLOURS = [0xffd35c, 0x62c6f2, 0x8fe08a, 0xf29bd0, 0xd0a6ff, 0xffa35c];

export class Probes {
  readonly object = new Group();
  on = false;
  private readonly shown = new Map<string, Trace>();
  private time = -1;

  constructor(private readonly stage: Stage) {
    stage.scene.add(this.object);
  }

  show(on: boolean): void {
    this.on = on;
    if (!on) this.clear();
    this.stage.invalidate();
  }

  take(measures: Measures): void {
    if (!this.on) return;
    // The scene was restarted, so the traces start anew.
    if (measures.simTimeS < this.time) this.clear();
    this.time = measures.simTimeS;
    for (const { id, positionM: at, restM: rest } of measures.probes) {
      if (!at) continue;
      let trace = this.shown.get(id);
      if (!trace) {
        trace = new Trace(id, COLOURS[this.shown.size % COLOURS.length]);
        this.shown.set(id, trace);
        this.object.add(trace.object);
      }
      trace.add(at, rest ? Math.hypot(at.x - rest.x, at.y - rest.y, at.z - rest.z) : 0);
    }
    this.stage.invalidate();
  }

  /** Called once per picture: moves the names beside their points. */
  place(): void {
    for (const trace of this.shown.values()) trace.place(this.stage);
  }

  private clear(): void {
    for (const trace of this.shown.values()) trace.dispose();
    this.shown.clear();
    this.time = -1;
  }
}

class Trace {
  readonly object = new Group();
  private readonly label = document.createElement("div");
  private readonly points = new Float32Array(3 * TRACE);
  private count = 0;
  private readonly line: Line;
  private readonly dot: Points;
  private readonly at = new Vector3();

  constructor(private readonly id: string, color: number) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(this.points, 3).setUsage(DynamicDrawUsage));
    this.line = new Line(geometry, new LineBasicMaterial({ color, toneMapped: false, depthTest: false, transparent: true, opacity: 0.9 }));
    const dot = new BufferGeometry();
    dot.setAttribute("position", new BufferAttribute(new Float32Array(3), 3).setUsage(DynamicDrawUsage));
    this.dot = new Points(dot, new PointsMaterial({ color, size: 9, sizeAttenuation: false, toneMapped: false, depthTest: false, transparent: true }));
    for (const object of [this.line, this.dot]) {
      object.frustumCulled = false;
      object.renderOrder = 6;
    }
    this.object.add(this.line, this.dot);
    this.label.style.borderLeft = `3px solid #${new Color(color).getHexString()}`;
    document.getElementById("labels")!.append(this.label);
  }

  add(at: { x: number; y: number; z: number }, moved: number): void {
    if (this.count === TRACE) {
      this.points.copyWithin(0, 3);
      this.count -= 1;
    }
    this.points.set([at.x, at.y, at.z], 3 * this.count);
    this.count += 1;
    this.line.geometry.setDrawRange(0, this.count);
    this.line.geometry.getAttribute("position").needsUpdate = true;
    const dot = this.dot.geometry.getAttribute("position") as BufferAttribute;
    dot.setXYZ(0, at.x, at.y, at.z);
    dot.needsUpdate = true;
    this.at.set(at.x, at.y, at.z);
    this.label.textContent = `${this.id} · moved ${length(moved)}`;
  }

  place(stage: Stage): void {
    const at = stage.project(this.at);
    this.label.hidden = !at.visible;
    this.label.style.transform = `translate(${(at.x + 9).toFixed(0)}px, ${(at.y + 6).toFixed(0)}px)`;
  }

  dispose(): void {
    this.object.removeFromParent();
    this.label.remove();
    for (const object of [this.line, this.dot]) {
      object.geometry.dispose();
      (object.material as LineBasicMaterial).dispose();
    }
  }
}

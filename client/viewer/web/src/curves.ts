// Curves over simulated time: force per tool and body, energies, time per step, age of the contact that hands feel.
// Nothing is stored while the curves are hidden.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { Forces } from "../gen/scindo/v1/force_pb";
import type { Measures, Stats } from "../gen/scindo/v1/server_pb";
import type { ToolState } from "../gen/scindo/v1/tool_pb";
import { engineering } from "./units";
import { ink, onTheme } from "./theme";
import { totals } from "./forces";

const COLOURS = ["#e58a7b", "#4f9ae0", "#5fb878", "#c98bdb", "#d9a441", "#3fb5b0"];
/** Most points of a curve; older ones are dropped. */
const POINTS = 1200;
const HEIGHT = 92;
const REFRESH_MS = 250;

export class Curves {
  on = false;
  private readonly box = document.getElementById("curves")!;
  private charts: Record<"force" | "contact" | "energy" | "step" | "age", Chart> | null = null;
  private readonly forces = new Map<string, number>();
  /** Bodies that something has touched. */
  private readonly touched = new Set<string>();
  private timer = 0;

  constructor() {
    onTheme(() => this.charts && Object.values(this.charts).forEach((chart) => chart.rebuild()));
    addEventListener("resize", () => this.charts && Object.values(this.charts).forEach((chart) => chart.rebuild()));
  }

  show(on: boolean): void {
    this.on = on;
    this.box.hidden = !on;
    clearInterval(this.timer);
    if (!on) {
      this.box.replaceChildren();
      this.charts = null;
      return;
    }
    const chart = (name: string, unit: string, none: string) => new Chart(this.box, name, unit, none);
    this.charts = {
      force: chart("force on tools", "N", "no tool yet"), contact: chart("force on bodies", "N", "no data yet"), energy: chart("energies", "J", "no data yet"),
      step: chart("time per step", "s", "no data yet"), age: chart("age of contact", "s", "no haptic device"),
    };
    this.timer = window.setInterval(() => Object.values(this.charts!).forEach((chart) => chart.draw()), REFRESH_MS);
  }

  /** Clears the curves for a scene with other tools and energies. */
  restart(): void {
    if (!this.on) return;
    this.forces.clear();
    this.touched.clear();
    this.show(false);
    this.show(true);
  }

  tool(state: ToolState): void {
    if (!this.charts) return;
    const f = state.forceN;
    this.forces.set(state.toolId, Math.hypot(f?.x ?? 0, f?.y ?? 0, f?.z ?? 0));
    this.charts.force.add(state.simTimeS, this.forces);
  }

  /** The size of all contact forces on each body together. A body that nothing touches has none. */
  contacts({ simTimeS, pairs }: Forces): void {
    if (!this.charts) return;
    const sums = totals(pairs);
    for (const id of this.touched) if (!sums.has(id)) sums.set(id, [0, 0, 0]);
    for (const id of sums.keys()) this.touched.add(id);
    this.charts.contact.add(simTimeS, new Map([...sums].map(([id, f]) => [id, Math.hypot(...f)])));
  }

  toolGone(id: string): void {
    this.forces.delete(id);
  }

  stats(stats: Stats): void {
    if (!this.charts || stats.paused) return;
    const stage = (name: string) => stats.stages.filter((s) => !name || s.name === name).reduce((sum, s) => sum + s.milliseconds, 0) / 1000;
    this.charts.step.add(stats.simTimeS, new Map([["all", stage("")], ["deform", stage("deform")]]));
    const ages = stats.tools.filter((tool) => tool.contactAgeMs > 0).map((tool): [string, number] => [tool.owner || tool.toolId, tool.contactAgeMs / 1000]);
    if (ages.length > 0) this.charts.age.add(stats.simTimeS, new Map(ages));
  }

  measures(measures: Measures): void {
    if (!this.charts) return;
    const sum = (of: "kineticJ" | "elasticJ") => measures.energies.reduce((total, body) => total + body[of], 0);
    this.charts.energy.add(measures.simTimeS, new Map([["elastic", sum("elasticJ")], ["kinetic", sum("kineticJ")]]));
  }

  /** Number of points of each chart, for tests. */
  get counts(): number[] {
    return this.charts ? Object.values(this.charts).map((chart) => chart.count) : [];
  }
}

class Chart {
  private readonly root = document.createElement("div");
  private readonly title = document.createElement("h3");
  private names: string[] = [];
  private data: (number | null)[][] = [[]];
  private plot: uPlot | null = null;
  private drawn = 0;

  constructor(box: HTMLElement, private readonly name: string, private readonly unit: string, private readonly none: string) {
    this.root.className = "curve";
    this.root.append(this.title);
    box.append(this.root);
    this.rebuild();
  }

  get count(): number {
    return this.data[0].length;
  }

  add(time: number, values: Map<string, number>): void {
    const times = this.data[0] as number[];
    const last = times.length > 0 ? times[times.length - 1] : -Infinity;
    // The scene was restarted.
    if (time < last) this.data = this.data.map(() => []);
    for (const name of values.keys()) {
      if (this.names.includes(name) || this.names.length >= COLOURS.length) continue;
      this.names.push(name);
      this.data.push(new Array<number | null>(this.data[0].length).fill(null));
      this.rebuild();
    }
    if (time === last) for (const column of this.data) column.pop();
    this.data[0].push(time);
    this.names.forEach((name, i) => this.data[i + 1].push(values.get(name) ?? null));
    if (this.data[0].length > POINTS) for (const column of this.data) column.shift();
    this.drawn = -1;
  }

  draw(): void {
    if (this.drawn === this.data[0].length || this.data[0].length === 0) return;
    this.drawn = this.data[0].length;
    this.plot?.setData(this.data as uPlot.AlignedData);
    this.names.forEach((name, i) => {
      const value = this.data[i + 1][this.data[i + 1].length - 1];
      const words = `${name} ${value === null || value === undefined ? "–" : engineering(value, this.unit)}`;
      const node = this.title.children[i];
      if (node && node.textContent !== words) node.textContent = words;
    });
  }

  rebuild(): void {
    this.plot?.destroy();
    this.plot = null;
    if (this.names.length === 0) {
      this.title.textContent = `${this.name}: ${this.none}`;
      return;
    }
    this.title.replaceChildren(this.name, ...this.names.map((_, i) => {
      const key = document.createElement("i");
      key.style.setProperty("--of", COLOURS[i]);
      return key;
    }));
    const axis = { stroke: ink("--muted"), grid: { stroke: ink("--line"), width: 1 }, ticks: { show: false }, font: "11px system-ui, sans-serif" };
    this.plot = new uPlot({
      width: Math.max(120, this.root.clientWidth), height: HEIGHT,
      legend: { show: false }, cursor: { show: false }, scales: { x: { time: false }, y: { range: (_, low, high) => [Math.min(0, low), high > 0 ? 1.08 * high : 1] } },
      axes: [
        { ...axis, size: 20, values: (_, ticks) => ticks.map((t) => `${+t.toFixed(2)} s`), space: 60 },
        { ...axis, size: 56, values: (_, ticks) => ticks.map((t) => engineering(t, this.unit)), space: 26 },
      ],
      series: [{}, ...this.names.map((name, i) => ({ label: name, stroke: COLOURS[i], width: 1.6, spanGaps: true }))],
    }, this.data as uPlot.AlignedData, this.root);
    this.drawn = -1;
  }
}

// Colours bodies by a quantity and shows its legend. Switched off, it costs nothing: no attribute, no
// message.

import { Color } from "three";
import { interpolateViridis, schemeTableau10 } from "d3-scale-chromatic";
import type { BodySurface } from "./body";
import type { Session } from "./session";
import type { Stats } from "../gen/scindo/v1/server_pb";
import { engineering, length } from "./units";

export type ColourMode = "tissue" | "displacement" | "stress" | "iterations" | "part";

const STEPS = 256;
/**
 * Viridis rises evenly in lightness, so equal steps look equal, in greyscale and to colour-blind people as
 * well.
 */
const MAP = lut(Array.from({ length: STEPS }, (_, i) => interpolateViridis(i / (STEPS - 1))));
const KINDS = lut(schemeTableau10.slice());
const NAMES: Record<ColourMode, string> = {
  tissue: "", displacement: "displacement", stress: "von Mises stress", iterations: "solver iterations", part: "loose parts",
};
/** Fraction per picture by which the range follows a falling maximum. */
const FORGET = 0.02;

export class Colours {
  mode: ColourMode = "tissue";
  /** Upper end of the legend, in the unit of the quantity. The lower end is zero. */
  high = 0;
  held = false;
  private seen = 0;
  private values: Float32Array = new Float32Array(0);
  private stats: Stats | null = null;
  private readonly at = (id: string) => document.getElementById(id)!;

  /** `onMode`: called when the topics that the page needs may have changed. */
  constructor(private readonly session: Session, private readonly onMode: () => void) {
    const hold = this.at("legend-hold") as HTMLButtonElement;
    hold.onclick = () => {
      this.held = !this.held;
      hold.setAttribute("aria-pressed", String(this.held));
      hold.textContent = this.held ? "held" : "hold";
    };
  }

  choose(mode: ColourMode): void {
    this.mode = mode;
    this.high = this.seen = 0;
    if (this.held) this.at("legend-hold").click();
    for (const body of this.session.bodies.values()) this.dress(body);
    this.at("legend").hidden = mode === "tissue";
    this.at("legend-hold").hidden = mode === "part";
    this.at("legend-name").textContent = NAMES[mode];
    this.refreshLegend();
    this.onMode();
  }

  /** Applies the present colours to a new body. */
  dress(body: BodySurface): void {
    if (this.mode !== "stress") body.stress = null;
    body.paint(this.mode === "tissue" ? null : (b, colours) => this.paint(b, colours));
  }

  setStats(stats: Stats): void {
    this.stats = stats;
    if (this.mode !== "iterations") return;
    for (const body of this.session.bodies.values()) body.touch();
  }

  /** Called once per picture, after all bodies were painted: the range follows the values. */
  advance(): void {
    if (this.mode === "tissue" || this.mode === "part") return;
    if (!this.held) {
      const next = this.seen >= this.high ? this.seen : this.high + FORGET * (this.seen - this.high);
      if (next !== this.high) {
        this.high = next;
        this.refreshLegend();
      }
    }
    this.seen = 0;
  }

  private paint(body: BodySurface, colours: Float32Array): void {
    const { source } = body.render!;
    if (this.mode === "part") {
      const { of } = body.parts;
      for (let r = 0; r < source.length; r++) put(colours, r, KINDS, (body.order + of[source[r]]) % (KINDS.length / 3));
      return;
    }
    const values = this.measure(body);
    let most = 0;
    for (let v = 0; v < body.vertexCount; v++) if (values[v] > most) most = values[v];
    this.seen = Math.max(this.seen, most);
    const high = Math.max(this.held ? this.high : Math.max(this.high, this.seen), 1e-30);
    for (let r = 0; r < source.length; r++) {
      put(colours, r, MAP, Math.min(STEPS - 1, Math.round((values[source[r]] / high) * (STEPS - 1))));
    }
  }

  /** The value of the quantity at every surface vertex. */
  private measure(body: BodySurface): Float32Array {
    if (this.values.length < body.vertexCount) this.values = new Float32Array(Math.ceil(1.5 * body.vertexCount));
    const out = this.values;
    if (this.mode === "displacement" && body.rest.length > 0) {
      const { positions: x, rest } = body;
      for (let v = 0, c = 0; v < body.vertexCount; v++, c += 3) out[v] = Math.hypot(x[c] - rest[c], x[c + 1] - rest[c + 1], x[c + 2] - rest[c + 2]);
    } else if (this.mode === "stress" && body.stress?.epoch === body.epoch && body.stress.values.length === body.vertexCount) {
      out.set(body.stress.values);
    } else if (this.mode === "iterations") {
      out.fill(this.stats?.bodies.find((stats) => stats.bodyId === body.id)?.iterations ?? 0, 0, body.vertexCount);
    } else if (this.mode !== "stress" || body.stress === null) {
      out.fill(0, 0, body.vertexCount);
    }
    return out;
  }

  private refreshLegend(): void {
    const bar = this.at("legend-bar");
    this.at("legend-low").textContent = this.mode === "part" ? "one colour per part" : "0";
    this.at("legend-high").textContent = this.mode === "part" ? "" : this.words(this.high);
    const stops = this.mode === "part" ? schemeTableau10.map((c, i) => `${c} ${10 * i}% ${10 * i + 10}%`)
      : Array.from({ length: 11 }, (_, i) => interpolateViridis(i / 10));
    bar.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
  }

  private words(value: number): string {
    if (this.mode === "displacement") return length(value);
    if (this.mode === "stress") return engineering(value, "Pa");
    return value.toFixed(0);
  }
}

/** Converts colour names to linear r g b. */
function lut(words: string[]): Float32Array {
  const out = new Float32Array(3 * words.length);
  words.forEach((word, i) => new Color(word).toArray(out, 3 * i));
  return out;
}

function put(to: Float32Array, r: number, from: Float32Array, i: number): void {
  to[3 * r] = from[3 * i];
  to[3 * r + 1] = from[3 * i + 1];
  to[3 * r + 2] = from[3 * i + 2];
}

// Live parameters as sliders, and the choice of scenes. The page asks the server only when the tray is
// opened.

import { Param_Kind, type Param, type ParamsReply, type ScenesReply } from "../gen/scindo/v1/server_pb";
import { element } from "./dom";
import type { Relay } from "./relay";
import { NO_OPERATOR, type Session } from "./session";

/** Number of positions of a slider. */
const STEPS = 400;
/** Period at which a moving slider sends its value [ms]. */
const TELL_MS = 120;

/** Names of keys for users, where they differ from the key. */
const NAMES: Record<string, string> = {
  "rayleigh.mass": "mass damping", "rayleigh.stiffness": "stiffness damping",
  "solver.iterations": "iterations", "solver.tolerance": "tolerance", young: "stiffness", poisson: "Poisson’s ratio",
};

export class Params {
  private readonly box = document.getElementById("params")!;
  private readonly scenes = element("div", "line");
  /** What the running scene shows. */
  private readonly about = element("p", "muted");
  private readonly list = element("div", "sliders");
  private scene = "";
  private timer = 0;
  /** Values to send, by key. Only the newest value of each key is sent. */
  private readonly waiting = new Map<string, string>();

  constructor(private readonly relay: Relay, private readonly session: Session) {
    this.box.append(this.scenes, this.about, this.list);
  }

  /** Called when the tray is opened or another scene runs. */
  ask(): void {
    if (!this.session.operator) {
      this.list.replaceChildren(element("p", "note", NO_OPERATOR));
      return;
    }
    this.relay.call({ case: "params", value: {} });
    this.relay.call({ case: "scenes", value: {} });
  }

  setScene(name: string): void {
    this.scene = name;
  }

  showScenes({ scenes }: ScenesReply): void {
    this.scenes.hidden = scenes.length === 0;
    const select = document.createElement("select");
    select.setAttribute("aria-label", "Scene");
    for (const scene of scenes) {
      const option = document.createElement("option");
      option.value = option.textContent = scene.name;
      option.title = scene.description;
      select.append(option);
    }
    select.value = this.scene;
    select.id = "scene-choice";
    select.onchange = () => {
      this.relay.call({ case: "load", value: { name: select.value } });
      select.blur();
    };
    this.about.textContent = scenes.find((scene) => scene.name === this.scene)?.description ?? "";
    this.scenes.replaceChildren(element("h2", "", "Scene"), select);
  }

  showParams({ params }: ParamsReply): void {
    const active = document.activeElement;
    // A slider in use is not replaced.
    if (active instanceof HTMLInputElement && this.list.contains(active)) return;
    const known = params.filter((param) => param.kind !== Param_Kind.UNSPECIFIED);
    this.list.replaceChildren();
    let group = "";
    for (const param of known) {
      if (groupOf(param.key) !== group) this.list.append(element("h2", "", (group = groupOf(param.key))));
      this.list.append(this.row(param));
    }
  }

  private row(param: Param): HTMLElement {
    const row = element("label", "param");
    row.title = `${param.meaning} (${param.key})`;
    row.append(element("span", "name", nameOf(param.key)));
    if (param.kind === Param_Kind.SWITCH) {
      const box = input("checkbox");
      box.checked = param.value === "true";
      box.onchange = () => this.tell(param.key, String(box.checked));
      row.append(box);
      return row;
    }
    const range = input("range"), value = element("output");
    range.max = String(STEPS);
    const vector = param.kind === Param_Kind.VECTOR ? numbers(param.value) : null;
    const start = vector ? Math.hypot(...vector) : Number(param.value);
    range.value = String(Math.round(STEPS * partOf(param, start)));
    const show = (x: number) => (value.textContent = `${words(x, param.kind === Param_Kind.INTEGER)} ${param.unit}`.trim());
    show(start);
    range.oninput = () => {
      const x = valueOf(param, Number(range.value) / STEPS);
      show(x);
      this.tell(param.key, vector ? scaled(vector, x) : param.kind === Param_Kind.INTEGER ? x.toFixed(0) : String(Number(x.toPrecision(4))));
    };
    range.onchange = () => range.blur();
    row.append(range, value);
    return row;
  }

  private tell(key: string, value: string): void {
    this.waiting.set(key, value);
    if (this.timer) return;
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      for (const [key, value] of this.waiting) this.relay.call({ case: "set", value: { key, value } });
      this.waiting.clear();
    }, TELL_MS);
  }
}

function input(type: string): HTMLInputElement {
  const node = document.createElement("input");
  node.type = type;
  return node;
}

/** The body of a key: `body.liver.young_pa` belongs to "liver". */
function groupOf(key: string): string {
  const [table, id] = key.split(".");
  return table === "body" ? id : table;
}

/** The name of a key: `body.liver.solver.iterations` is "iterations". */
function nameOf(key: string): string {
  const words = key.replace(/^body\.[^.]*\.|^(world|effects)\./, "").replace(/_(pa|m_s2|s|1_s)$/, "");
  return NAMES[words] ?? words.replaceAll(/[._]/g, " ");
}

/** Position of a value between the ends of its slider, 0 to 1. */
function partOf(param: Param, x: number): number {
  const { usualMin: low, usualMax: high } = param;
  const part = isLogarithmic(param) ? Math.log(x / low) / Math.log(high / low) : (x - low) / (high - low);
  return Number.isFinite(part) ? Math.min(1, Math.max(0, part)) : 0;
}

function valueOf(param: Param, part: number): number {
  const { usualMin: low, usualMax: high } = param;
  const x = isLogarithmic(param) ? low * (high / low) ** part : low + part * (high - low);
  return param.kind === Param_Kind.INTEGER ? Math.round(x) : x;
}

function isLogarithmic(param: Param): boolean {
  return param.logarithmic && param.usualMin > 0 && param.usualMax > param.usualMin;
}

function numbers(text: string): number[] {
  const found = text.replace(/[[\]]/g, "").split(",").map(Number);
  return found.length === 3 && found.every(Number.isFinite) ? found : [0, 0, 0];
}

/** The vector scaled to another length. A zero vector becomes one along −z. */
function scaled(vector: number[], length: number): string {
  const now = Math.hypot(...vector);
  const at = now > 0 ? vector.map((c) => (c / now) * length) : [0, 0, -length];
  return `[${at.map((c) => Number(c.toPrecision(5))).join(", ")}]`;
}

function words(x: number, whole: boolean): string {
  if (whole) return x.toFixed(0);
  const size = Math.abs(x);
  return size !== 0 && (size >= 1e5 || size < 1e-2) ? x.toExponential(2).replace("e-", "e−").replace("e+", "e") : String(Number(x.toPrecision(3)));
}

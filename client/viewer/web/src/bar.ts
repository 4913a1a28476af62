// Toolbar buttons and keyboard shortcuts.

import { boundsOf, PRESETS, type Preset, type Stage } from "./stage";
import type { Hand, HandMode } from "./hand";
import type { Help } from "./help";
import type { Relay } from "./relay";
import { NO_OPERATOR, type Session } from "./session";
import type { View } from "./view";
import { length } from "./units";

const HINTS: Record<HandMode, string> = {
  orbit: "drag to turn the view · wheel: zoom · Poke, Grab, Cut and Forceps touch the tissue · ? shows all keys",
  poke: "drag on the tissue to press it · wheel: depth · to turn the view: Shift, right button, or drag beside it",
  grab: "drag the tissue to pull it · wheel: push and pull · to turn the view: Shift, right button, or drag beside it",
  forceps: "press to close the jaws on the tissue, drag to pull it · K: keep them closed · J: turn them · wheel: depth",
  cut: "draw the cut on the tissue · wheel: depth · to turn the view: Shift, right button, or drag beside it",
};
const KEYS: Record<string, HandMode> = { "1": "poke", "2": "grab", "3": "cut", c: "cut", "4": "forceps", o: "orbit", "0": "orbit", escape: "orbit" };
const CAMERAS: Record<string, Preset> = { "5": "front", "6": "right", "7": "top", "8": "corner" };
/** Steps of the arrow keys: across the picture (0 to 1 is half of it), and angles of the view [rad]. */
const ARROWS: Record<string, [number, number]> = { arrowleft: [-1, 0], arrowright: [1, 0], arrowup: [0, 1], arrowdown: [0, -1] };
const STEP = 0.02, ANGLE = 0.06, ZOOM = 1.12, DEPTH = 0.02;
/** A second click on Reset must follow within this time. */
const SURE_MS = 5000;
/** Below this window width [px] the numbers are hidden at first. */
const NARROW = 1000;

export class Bar {
  private readonly buttons = [...document.querySelectorAll<HTMLButtonElement>("button[data-hand]")];
  private readonly pause = document.getElementById("pause") as HTMLButtonElement;
  private readonly step = document.getElementById("step") as HTMLButtonElement;
  private readonly reset = document.getElementById("reset") as HTMLButtonElement;
  private readonly undo = document.getElementById("undo") as HTMLButtonElement;
  private readonly range = document.getElementById("depth-range") as HTMLInputElement;
  private readonly jaws = document.getElementById("jaws") as HTMLButtonElement;
  private asked = 0;

  constructor(
    private readonly stage: Stage,
    private readonly session: Session,
    private readonly relay: Relay,
    private readonly hand: Hand,
    private readonly view: View,
    private readonly help: Help,
  ) {
    for (const button of this.buttons) {
      button.setAttribute("role", "radio");
      button.onclick = () => this.hand.choose(button.dataset["hand"] as HandMode);
    }
    for (const button of document.querySelectorAll<HTMLButtonElement>("button[data-preset]")) {
      button.onclick = () => this.fit(button.dataset["preset"] as Preset);
    }
    this.pause.onclick = () => this.relay.call({ case: "pause", value: { paused: !this.session.paused } });
    this.step.onclick = () => this.relay.call({ case: "step", value: { count: 1 } });
    this.undo.onclick = () => this.relay.call({ case: "undo", value: {} });
    this.reset.onclick = () => this.askReset();
    document.getElementById("fit")!.onclick = () => this.fit();
    document.getElementById("toggle")!.onclick = () => this.toggle();
    document.getElementById("view-toggle")!.onclick = () => this.view.toggle();
    document.getElementById("help-toggle")!.onclick = () => this.help.toggle();
    this.jaws.onclick = () => this.hand.keepClosed(!this.hand.keepsClosed);
    this.range.oninput = () => this.hand.setDepth(Number(this.range.value));
    document.addEventListener("keydown", (e) => this.onKey(e));
    // A button that the mouse has pressed gives the keyboard back; one that the keyboard has reached keeps it.
    document.addEventListener("click", (e) => {
      if (e.detail > 0 && e.target instanceof Element) e.target.closest<HTMLElement>("button, summary")?.blur();
    });
    if (innerWidth <= NARROW) this.toggle();
    document.body.dataset["hand"] = "orbit";
    hand.onChange = () => this.refresh();
    this.refresh();
  }

  refresh(): void {
    for (const button of this.buttons) {
      button.setAttribute("aria-checked", String(button.dataset["hand"] === this.hand.mode));
      if (button.dataset["hand"] !== "orbit") button.disabled = this.session.readOnly;
    }
    this.jaws.hidden = this.hand.mode !== "forceps";
    this.jaws.setAttribute("aria-pressed", String(this.hand.keepsClosed));
    this.jaws.querySelector("span")!.textContent = this.hand.keepsClosed ? "Open" : "Keep closed";
    const { value, min, max } = this.hand.depthRange;
    this.range.min = String(min);
    this.range.max = String(max);
    this.range.value = String(value);
    document.getElementById("depth-value")!.textContent = length(this.hand.depthM);
    document.getElementById("hint")!.textContent = HINTS[this.hand.mode];
    this.pause.querySelector("span")!.textContent = this.session.paused ? "Resume" : "Pause";
    this.pause.querySelector("path")!.setAttribute("d", this.session.paused ? "M7 5l12 7-12 7z" : "M8 5v14M16 5v14");
    const { operator, paused } = this.session;
    this.pause.disabled = this.reset.disabled = !operator;
    this.undo.disabled = !operator || !this.hasCuts;
    this.step.disabled = !operator || !paused;
    this.pause.parentElement!.title = operator ? "" : NO_OPERATOR;
  }

  fit(preset?: Preset): void {
    const box = boundsOf(this.session.bodies.values());
    if (!box.isEmpty()) this.stage.fit(box, preset);
  }

  private get hasCuts(): boolean {
    return [...this.session.bodies.values()].some((body) => body.lipTriangles > 0 || body.marks.count > 0);
  }

  /** A reset loses all cuts, so a second click must confirm it. */
  private askReset(): void {
    const cuts = this.hasCuts;
    const words = this.reset.querySelector("span")!;
    if (cuts && performance.now() - this.asked > SURE_MS) {
      this.asked = performance.now();
      this.reset.classList.add("sure");
      words.textContent = "Lose cuts?";
      setTimeout(() => this.calm(), SURE_MS);
      return;
    }
    this.calm();
    this.relay.call({ case: "reset", value: {} });
  }

  private calm(): void {
    this.asked = -Infinity;
    this.reset.classList.remove("sure");
    this.reset.querySelector("span")!.textContent = "Reset";
  }

  private onKey(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    if (e.target instanceof HTMLInputElement && e.target.type === "text") return;
    if (e.target instanceof HTMLSelectElement || (e.target instanceof HTMLInputElement && e.target.type === "range" && e.key.startsWith("Arrow"))) return;
    const key = e.key.toLowerCase();
    if ((key === " " || key === "enter") && e.target instanceof Element && e.target.closest("button, summary, input:not([type=range])")) return;
    if (e.key === "?" || (key === "escape" && this.help.isOpen)) {
      this.help.toggle();
      return;
    }
    const mode = KEYS[key], preset = CAMERAS[key];
    if (mode) {
      if (mode === "orbit" || !this.session.readOnly) this.hand.choose(mode);
    } else if (preset && preset in PRESETS) this.fit(preset);
    else if (ARROWS[key]) this.onArrow(...ARROWS[key], e.shiftKey);
    else if (key === "+" || key === "=") this.stage.zoomBy(1 / ZOOM);
    else if (key === "-") this.stage.zoomBy(ZOOM);
    else if (key === "enter" && this.hand.mode !== "orbit") this.hand.togglePress();
    else if ((key === "pagedown" || key === "pageup") && this.hand.mode !== "orbit") {
      this.hand.setDepth(this.hand.depthRange.value + (key === "pagedown" ? DEPTH : -DEPTH));
    }
    else if (key === " ") this.pause.click();
    else if (key === ".") this.step.click();
    else if (key === "r") this.reset.click();
    else if (key === "u") this.undo.click();
    else if (key === "k" && !this.jaws.hidden) this.jaws.click();
    else if (key === "j") this.hand.turn();
    else if (key === "f") this.fit();
    else if (key === "h") this.toggle();
    else if (key === "v") this.view.toggle();
    else if (key === "p") this.view.savePicture();
    else return;
    e.preventDefault();
  }

  /** Without a tool, or with Shift, the arrow keys turn the view, else they move the tool. */
  private onArrow(across: number, up: number, shift: boolean): void {
    if (this.hand.mode === "orbit" || shift) this.stage.turnBy(-ANGLE * across, ANGLE * up);
    else this.hand.steer(STEP * across, STEP * up);
  }

  private toggle(): void {
    const bare = document.body.classList.toggle("bare");
    // A phone has room for only one of them.
    if (!bare && innerWidth <= 640) this.view.toggle(false);
    document.getElementById("toggle")!.setAttribute("aria-pressed", String(!bare));
    this.stage.relayout();
  }
}

// Buttons and keys.

import { boundsOf, type Stage } from "./stage";
import type { Hand, HandMode } from "./hand";
import type { Relay } from "./relay";
import type { Session } from "./session";
import { length } from "./units";

const HINTS: Record<HandMode, string> = {
  orbit: "drag turns the view, the wheel zooms · Poke, Grab and Cut touch the tissue",
  poke: "drag on the tissue to press · wheel sets the depth · drag beside it, Shift or right button turns the view",
  grab: "drag the tissue to pull it · wheel pushes and pulls · drag beside it, Shift or right button turns the view",
  cut: "draw the cut on the tissue · wheel sets its depth · drag beside it, Shift or right button turns the view",
};
const KEYS: Record<string, HandMode> = { "1": "poke", "2": "grab", "3": "cut", c: "cut", o: "orbit", "0": "orbit", escape: "orbit" };

export class Bar {
  private readonly buttons = [...document.querySelectorAll<HTMLButtonElement>("button[data-hand]")];
  private readonly pause = document.getElementById("pause") as HTMLButtonElement;
  private readonly step = document.getElementById("step") as HTMLButtonElement;
  private readonly reset = document.getElementById("reset") as HTMLButtonElement;
  private readonly range = document.getElementById("depth-range") as HTMLInputElement;

  constructor(
    private readonly stage: Stage,
    private readonly session: Session,
    private readonly relay: Relay,
    private readonly hand: Hand,
  ) {
    for (const button of this.buttons) {
      button.setAttribute("role", "radio");
      button.onclick = () => this.hand.choose(button.dataset["hand"] as HandMode);
    }
    this.pause.onclick = () => this.relay.call({ case: "pause", value: { paused: !this.session.paused } });
    this.step.onclick = () => this.relay.call({ case: "step", value: { count: 1 } });
    this.reset.onclick = () => this.relay.call({ case: "reset", value: {} });
    document.getElementById("fit")!.onclick = () => this.fit();
    document.getElementById("toggle")!.onclick = () => this.toggle();
    this.range.oninput = () => this.hand.setDepth(Number(this.range.value));
    document.addEventListener("keydown", (e) => this.onKey(e));
    if (innerWidth <= 760) this.toggle();
    document.body.dataset["hand"] = "orbit";
    hand.onChange = () => this.refresh();
    this.refresh();
  }

  refresh(): void {
    for (const button of this.buttons) {
      button.setAttribute("aria-checked", String(button.dataset["hand"] === this.hand.mode));
      if (button.dataset["hand"] !== "orbit") button.disabled = this.session.readOnly;
    }
    const { value, min, max } = this.hand.depthRange;
    this.range.min = String(min);
    this.range.max = String(max);
    this.range.value = String(value);
    document.getElementById("depth-value")!.textContent = length(this.hand.depthM);
    document.getElementById("hint")!.textContent = HINTS[this.hand.mode];
    this.pause.querySelector("span")!.textContent = this.session.paused ? "Go on" : "Pause";
    this.pause.querySelector("path")!.setAttribute("d", this.session.paused ? "M7 5l12 7-12 7z" : "M8 5v14M16 5v14");
    this.pause.disabled = this.reset.disabled = this.session.readOnly;
    this.step.disabled = this.session.readOnly || !this.session.paused;
  }

  private onKey(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey || e.target instanceof HTMLInputElement) return;
    const key = e.key.toLowerCase();
    const mode = KEYS[key];
    if (mode) this.hand.choose(mode);
    else if (key === " ") this.pause.click();
    else if (key === ".") this.step.click();
    else if (key === "r") this.reset.click();
    else if (key === "f") this.fit();
    else if (key === "h") this.toggle();
    else return;
    e.preventDefault();
  }

  private fit(): void {
    const box = boundsOf(this.session.bodies.values());
    if (!box.isEmpty()) this.stage.fit(box);
  }

  private toggle(): void {
    document.body.classList.toggle("bare");
    this.stage.relayout();
  }
}

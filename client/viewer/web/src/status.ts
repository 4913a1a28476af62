// Connection status: the label in the header, and the card over the picture when nothing can be shown.

import type { ViewerHello, ViewerLink } from "../gen/scindo/v1/viewer_pb";
import type { Stats } from "../gen/scindo/v1/server_pb";
import { setText } from "./dom";

/**
 * The stream counts as stalled without a frame for this long [ms] or for this many past frame intervals,
 * unless paused.
 */
const SILENT_MS = 600;
const SILENT_GAPS = 4;

export class Status {
  hello: ViewerHello | null = null;
  private link: ViewerLink | null = null;
  private open = false;
  private everOpen = false;
  private frames = 0;
  private lastFrame = 0;
  private gapMs = 0;
  private readonly pill = document.getElementById("link")!;
  private readonly card = document.getElementById("overlay")!;

  connection(open: boolean): void {
    this.open = open;
    this.everOpen ||= open;
    if (!open) this.link = null;
  }

  /** Updates the link. Returns whether the server went, came back, or neither. */
  setLink(link: ViewerLink): "gone" | "back" | null {
    const before = this.link;
    this.link = link;
    if (!before || before.connected === link.connected) return null;
    return link.connected ? "back" : "gone";
  }

  frame(now: number): void {
    if (this.frames > 0) this.gapMs += 0.1 * (Math.min(now - this.lastFrame, 10_000) - this.gapMs);
    this.frames += 1;
    this.lastFrame = now;
  }

  /** Time without a frame [ms] if it is too long, otherwise 0. */
  silentMs(now: number, stats: Stats | null): number {
    const silent = now - this.lastFrame;
    const patience = Math.max(SILENT_MS, SILENT_GAPS * this.gapMs);
    return this.frames > 0 && !stats?.paused && silent > patience ? silent : 0;
  }

  refresh(now: number, stats: Stats | null): void {
    const connected = this.open && this.link?.connected === true;
    const silent = this.silentMs(now, stats);
    const [state, text] = !this.open
      ? ["gone", this.everOpen ? "viewer unreachable" : "connecting"]
      : !connected ? ["wait", "waiting for the server"]
      : stats?.paused ? ["paused", "paused"]
      : silent > 0 ? ["stalled", `stalled for ${(silent / 1000).toFixed(0)} s`]
      : ["live", "live"];
    if (this.pill.dataset["state"] !== state) this.pill.dataset["state"] = state;
    setText(this.pill, text);
    this.pill.title = state === "stalled" ? "No new picture arrives. The server is busy with a long step, or it stopped answering." : this.link?.detail ?? "";
    const up = connected && this.frames > 0;
    this.card.classList.toggle("hidden", up);
    if (!up) this.say(...this.words(connected));
  }

  private words(connected: boolean): [string, string] {
    if (!this.open) {
      return this.everOpen
        ? ["The viewer is unreachable", "The program that serves this page does not answer. The page reconnects when it is back."]
        : ["Connecting", location.host];
    }
    if (connected) return ["Waiting for the first surface", this.link?.detail ?? ""];
    return [this.frames > 0 ? "The simulation server is unreachable" : "Looking for a simulation server", this.link?.detail || this.hello?.upstream || ""];
  }

  private say(title: string, words: string): void {
    setText(this.card.querySelector("h1")!, title);
    setText(this.card.querySelector("p")!, words);
  }
}

/** Tells the user once that this browser cannot draw. */
export function sayNoWebGl(): void {
  const card = document.getElementById("overlay")!;
  card.classList.remove("hidden");
  card.firstElementChild!.classList.add("final");
  card.querySelector("h1")!.textContent = "This browser cannot draw the scene";
  card.querySelector("p")!.textContent =
    "The page needs WebGL 2, which is switched off or missing here.\nSwitch on hardware acceleration in the browser's settings, or open this address in a current Chrome, Firefox, Edge or Safari.\nThe simulation itself continues.";
  const pill = document.getElementById("link")!;
  pill.dataset["state"] = "gone";
  pill.textContent = "no WebGL";
}

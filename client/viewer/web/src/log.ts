// The event log, folded: one line per kind of event while it repeats.

import { Event_Level, type Event } from "../gen/scindo/v1/server_pb";

/**
 * Rows of the log, time that the last rows stay bright, and time within which events of one kind share a
 * line.
 */
const ROWS = 6;
const BRIGHT_MS = 8000;
const FOLD_MS = 20_000;

export type Level = "info" | "warning" | "error";

/** Kinds of events that another kind already covers. */
const SILENT = ["cut-answered"];

export class Log {
  private readonly box = document.getElementById("log")!;

  event(event: Event): void {
    if (SILENT.includes(event.name)) return;
    const level: Level = event.level === Event_Level.ERROR ? "error" : event.level === Event_Level.WARNING ? "warning" : "info";
    this.line(plain(event) || event.name, level, event.name);
  }

  /** Adds a line. It replaces and counts a recent line of the same kind. */
  line(text: string, level: Level, kind = ""): void {
    const now = performance.now();
    const rows = [...this.box.children] as HTMLElement[];
    const old = kind ? rows.find((row) => row.dataset["kind"] === kind && now - Number(row.dataset["at"]) < FOLD_MS) : undefined;
    const times = old ? Number(old.dataset["times"]) + 1 : 1;
    old?.remove();
    const row = document.createElement("div");
    Object.assign(row.dataset, { level, kind, times: String(times), at: String(now) });
    const time = document.createElement("time");
    time.textContent = new Date().toTimeString().slice(0, 8);
    row.append(time, text);
    if (times > 1) row.append(Object.assign(document.createElement("span"), { className: "times", textContent: `×${times}` }));
    this.box.append(row);
    while (this.box.children.length > ROWS) this.box.firstElementChild!.remove();
    setTimeout(() => row.classList.add("old"), BRIGHT_MS);
  }
}

/** Describes an event in a user's words. */
function plain(event: Event): string {
  const body = /^([a-z0-9_-]+): /.exec(event.message)?.[1];
  switch (event.name) {
    case "cut-applied": return body ? `${body} is cut` : event.message;
    case "reset": return "back at the start of the scene";
    default: return event.message;
  }
}

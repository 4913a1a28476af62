// Live numbers, the plan of effects, the log, and what to say when nobody answers.

import type { Relay } from "./relay";
import type { ViewerHello, ViewerLink, ViewerRpcReply } from "../gen/scindo/v1/viewer_pb";
import { Event_Level, type Event, type Plan, type SessionInfo, type Stats } from "../gen/scindo/v1/server_pb";
import type { SurfaceFrame } from "../gen/scindo/v1/surface_pb";
import { Rate, Smooth } from "./rate";
import { count, exponent, short, volume } from "./units";

/** Rows of the log, and how long the last ones stay bright. */
const LOG_ROWS = 7;
const LOG_BRIGHT_MS = 8000;
/** No frame for this long while not paused: say so. */
const SILENT_MS = 2500;
const REFRESH_MS = 250;

type Level = "info" | "warning" | "error";

export class Panel {
  readonly surfaceRate = new Rate();
  readonly pictureRate = new Rate();
  readonly latency = new Smooth();
  stats: Stats | null = null;
  plan: Plan | null = null;
  private frames = 0;
  private lastFrame = 0;
  private socketOpen = false;
  private everOpen = false;
  private link: ViewerLink | null = null;
  private hello: ViewerHello | null = null;
  private readonly at = (id: string) => document.getElementById(id)!;

  constructor(private readonly relay: Relay) {
    setInterval(() => this.refresh(), REFRESH_MS);
    this.refresh();
  }

  showConnection(open: boolean): void {
    this.socketOpen = open;
    this.everOpen ||= open;
    if (!open) this.link = null;
    this.refresh();
  }

  showHello(hello: ViewerHello): void {
    this.hello = hello;
  }

  showLink(link: ViewerLink): void {
    if (this.link && link.connected !== this.link.connected) {
      this.line(link.connected ? "server is back" : "server is gone", link.connected ? "info" : "error");
    }
    this.link = link;
    this.refresh();
  }

  showInfo(info: SessionInfo): void {
    this.at("scene").textContent = info.sceneName;
    document.title = info.sceneName ? `${info.sceneName} · scindo` : "scindo";
  }

  showStats(stats: Stats): void {
    this.stats = stats;
  }

  showPlan(plan: Plan): void {
    this.plan = plan;
    const on = plan.effects.filter((effect) => effect.on).length;
    this.at("effects-count").textContent = `${on} of ${plan.effects.length} on`;
    this.at("effects").replaceChildren(
      ...[...plan.effects].sort((a, b) => Number(b.on) - Number(a.on)).map((effect) => {
        const row = element("div", effect.on ? "effect on" : "effect");
        const cost = effect.on && effect.measuredMs > 0 ? ` · ${short(effect.measuredMs)} ms` : "";
        row.append(element("i"), element("span", "name", effect.name.replaceAll("_", " ")), element("span", "why", effect.why + cost));
        row.title = `${effect.name}: ${effect.on ? "on" : "off"}, ${effect.why}${cost}`;
        return row;
      }),
    );
  }

  countFrame(frame: SurfaceFrame, _bytes: number): void {
    this.frames += 1;
    this.lastFrame = performance.now();
    this.surfaceRate.count(this.lastFrame);
    const age = this.relay.ageMs(frame.publishUnixNs);
    if (Number.isFinite(age)) this.latency.add(age);
  }

  countPicture(now: number): void {
    this.pictureRate.count(now);
  }

  log(event: Event): void {
    if (this.isOwn(event)) return;
    const level: Level = event.level === Event_Level.ERROR ? "error" : event.level === Event_Level.WARNING ? "warning" : "info";
    this.line(event.message || event.name, level, event.name);
  }

  /** Whether an event only tells that this page's mouse comes and goes. */
  private isOwn(event: Event): boolean {
    const tool = this.hello?.toolId;
    return !!tool && /^tool-(taken|released)$/.test(event.name) && event.message.includes(`'${tool}'`);
  }

  showRpc(answer: ViewerRpcReply): void {
    const { reply } = answer;
    if (!reply) return;
    if (reply.ok) this.line(reply.message || "done", "info");
    else this.line(`${reply.error?.message ?? "refused"} ${reply.error?.hint ?? ""}`.trim(), "error");
  }

  /** Adds a line; one of the same kind right after another takes its place and counts it. */
  private line(text: string, level: Level, kind = ""): void {
    const log = this.at("log");
    const last = log.lastElementChild as HTMLElement | null;
    let times = 1;
    if (last && kind && last.dataset["kind"] === kind) {
      times += Number(last.dataset["times"]);
      last.remove();
    }
    const row = element("div");
    Object.assign(row.dataset, { level, kind, times: String(times) });
    row.append(element("time", "", new Date().toTimeString().slice(0, 8)), text);
    if (times > 1) row.append(element("span", "times", `×${times}`));
    log.append(row);
    while (log.children.length > LOG_ROWS) log.firstElementChild!.remove();
    setTimeout(() => row.classList.add("old"), LOG_BRIGHT_MS);
  }

  private refresh(): void {
    const now = performance.now();
    this.surfaceRate.advance(now);
    this.pictureRate.advance(now);
    this.refreshLink(now);
    const stats = this.stats;
    this.refreshGauges(stats);
    this.refreshStream(stats);
    if (!stats) return;
    this.refreshStages(stats);
    this.refreshBodies(stats);
    this.refreshTools(stats);
  }

  private refreshLink(now: number): void {
    const silent = this.frames > 0 && now - this.lastFrame > SILENT_MS && !this.stats?.paused;
    const pill = this.at("link");
    const connected = this.socketOpen && this.link?.connected === true;
    const [state, text] = !this.socketOpen
      ? ["gone", this.everOpen ? "viewer is gone" : "connecting"]
      : !connected ? ["wait", "waiting for the server"]
      : this.stats?.paused ? ["paused", "paused"]
      : silent ? ["wait", "no frames"]
      : ["live", "live"];
    pill.dataset["state"] = state;
    pill.textContent = text;
    pill.title = this.link?.detail ?? "";
    const card = this.at("overlay");
    const up = connected && this.frames > 0;
    card.classList.toggle("hidden", up);
    if (up) return;
    const [title, words] = !this.socketOpen
      ? [this.everOpen ? "The viewer is gone" : "Connecting", this.everOpen ? "The program that serves this page stopped. The page goes on by itself when it is back." : location.host]
      : !connected ? [this.frames > 0 ? "The simulation server is gone" : "Looking for a simulation server", `${this.link?.detail || this.hello?.upstream || ""}`]
      : ["Waiting for the first surface", this.link?.detail ?? ""];
    card.querySelector("h1")!.textContent = title;
    card.querySelector("p")!.textContent = words;
  }

  private refreshGauges(stats: Stats | null): void {
    const factor = stats?.realTimeFactor ?? NaN;
    const latency = this.latency.value;
    const gauges: [string, string, string, string?][] = [
      [short(stats?.stepRateHz ?? NaN), "Hz", "step rate"],
      [short(factor), "×", "real time", factor < 0.5 ? "bad" : factor < 0.9 ? "warn" : ""],
      [short(latency >= -2 ? Math.max(0, latency) : NaN), "ms", "latency", latency > 250 ? "bad" : latency > 100 ? "warn" : ""],
      [short(this.surfaceRate.value), "Hz", "surface"],
      [short(this.pictureRate.value), "fps", "drawn"],
      [(stats?.simTimeS ?? NaN) >= 0 ? stats!.simTimeS.toFixed(2) : "–", "s", "sim time"],
    ];
    const box = this.at("gauges");
    while (box.children.length < gauges.length) {
      const gauge = element("div", "gauge");
      gauge.append(element("b"), element("span"));
      box.append(gauge);
    }
    gauges.forEach(([value, unit, name, level], i) => {
      const gauge = box.children[i] as HTMLElement;
      gauge.dataset["level"] = stats?.paused ? "" : level ?? "";
      gauge.firstElementChild!.replaceChildren(value, element("small", "", unit));
      setText(gauge.lastElementChild!, name);
    });
  }

  private refreshStages(stats: Stats): void {
    const total = stats.stages.reduce((sum, stage) => sum + stage.milliseconds, 0);
    const most = Math.max(1e-6, ...stats.stages.map((stage) => stage.milliseconds));
    setText(this.at("stage-total"), `${short(total)} ms`);
    const box = this.at("stages");
    while (box.children.length > stats.stages.length) box.lastElementChild!.remove();
    while (box.children.length < stats.stages.length) {
      const row = element("div", "stage");
      const track = element("div", "track");
      track.append(element("div", "fill"));
      row.append(element("span", "muted"), track, element("span", "ms"));
      box.append(row);
    }
    stats.stages.forEach((stage, i) => {
      const row = box.children[i];
      setText(row.children[0], stage.name.replaceAll("_", " "));
      (row.children[1].firstElementChild as HTMLElement).style.transform = `scaleX(${(stage.milliseconds / most).toFixed(3)})`;
      setText(row.children[2], short(stage.milliseconds));
    });
  }

  private refreshBodies(stats: Stats): void {
    const rows: Row[] = [];
    for (const body of stats.bodies) {
      rows.push([body.bodyId, `epoch ${body.epoch}`, "title"]);
      rows.push(["elements · copies", `${count(body.pieces || body.elements)} · ${count(body.copies)}`]);
      rows.push(["iterations · residual", `${body.iterations} · ${exponent(body.residual)}`]);
      if (body.volumeM3 > 0) rows.push(["volume", volume(body.volumeM3)]);
    }
    setRows(this.at("bodies"), rows);
  }

  private refreshTools(stats: Stats): void {
    const rows: Row[] = stats.tools.map((tool) => [
      tool.owner && tool.owner !== tool.toolId ? `${tool.toolId} · ${tool.owner}` : tool.toolId,
      `${short(tool.forceN)} N${tool.contactRateHz > 0 ? ` · ${short(tool.contactRateHz)} Hz` : ""}`,
    ]);
    setRows(this.at("tools"), rows.length > 0 ? rows : [["none", ""]]);
  }

  private refreshStream(stats: Stats | null): void {
    const rows: Row[] = [
      ["round trip to viewer", `${short(this.relay.roundTripMs)} ms`],
      ["browsers · viewers · haptics", `${this.relay.browsers} · ${stats?.surfaceSubscribers ?? "–"} · ${stats?.hapticClients ?? "–"}`],
      ["frames skipped here", count(this.relay.framesDropped)],
      ["cut commands applied", `${stats?.cutsApplied ?? "–"}`],
    ];
    const refused = stats?.refused.filter((counter) => counter.count > 0n) ?? [];
    if (refused.length === 0) rows.push(["refused", "0"]);
    for (const counter of refused) rows.push([`refused: ${counter.name}`, count(Number(counter.count)), "bad"]);
    setRows(this.at("stream"), rows);
  }
}

type Row = [key: string, value: string, kind?: string];

/** Fills a list of key and value, touching the page only where a text changed. */
function setRows(box: Element, rows: Row[]): void {
  while (box.children.length > rows.length) box.lastElementChild!.remove();
  while (box.children.length < rows.length) {
    const row = element("div", "row");
    row.append(element("span", "key"), element("span", "value"));
    box.append(row);
  }
  rows.forEach(([key, value, kind], i) => {
    const row = box.children[i] as HTMLElement;
    row.className = kind === "title" ? "row title" : "row";
    row.dataset["level"] = kind === "bad" ? "bad" : "";
    setText(row.children[0], key);
    setText(row.children[1], value);
  });
}

function setText(node: Element, text: string): void {
  if (node.textContent !== text) node.textContent = text;
}

function element(tag: string, className = "", text = ""): HTMLElement {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (text) node.textContent = text;
  return node;
}

// Live numbers and the plan of effects.

import type { Relay } from "./relay";
import type { ViewerHello, ViewerLink, ViewerRpcReply } from "../gen/scindo/v1/viewer_pb";
import type { BodyStats, Event, Plan, SessionInfo, Stats, ToolStats } from "../gen/scindo/v1/server_pb";
import type { SurfaceFrame } from "../gen/scindo/v1/surface_pb";
import { element, setRows, setText, type Row } from "./dom";
import { Log } from "./log";
import { Rate, Smooth } from "./rate";
import { Status } from "./status";
import { troubles } from "./trouble";
import { count, exponent, short, volume } from "./units";

const REFRESH_MS = 200;

export class Panel {
  readonly surfaceRate = new Rate();
  readonly pictureRate = new Rate();
  readonly latency = new Smooth();
  readonly log = new Log();
  stats: Stats | null = null;
  plan: Plan | null = null;
  private readonly status = new Status();
  private readonly at = (id: string) => document.getElementById(id)!;

  constructor(private readonly relay: Relay) {
    setInterval(() => this.refresh(), REFRESH_MS);
    this.refresh();
  }

  showConnection(open: boolean): void {
    this.status.connection(open);
    this.refresh();
  }

  showHello(hello: ViewerHello): void {
    this.status.hello = hello;
  }

  showLink(link: ViewerLink): void {
    const change = this.status.setLink(link);
    if (change) this.log.line(`server is ${change === "back" ? "back" : "unreachable"}`, change === "back" ? "info" : "error");
    this.refresh();
  }

  showInfo(info: SessionInfo): void {
    this.at("scene").textContent = info.sceneName;
    this.at("scene").title = info.sceneDescription;
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
    const now = performance.now();
    this.status.frame(now);
    this.surfaceRate.count(now);
    const age = this.relay.ageMs(frame.publishUnixNs);
    if (Number.isFinite(age)) this.latency.add(age);
  }

  countPicture(now: number): void {
    this.pictureRate.count(now);
  }

  event(event: Event): void {
    // The page's own mouse tool comes and goes; that is not reported.
    const tool = this.status.hello?.toolId;
    if (tool && /^tool-(taken|released)$/.test(event.name) && event.message.includes(`'${tool}'`)) return;
    this.log.event(event);
  }

  /** Shows refusals only. Events report what the server did. */
  showRpc(answer: ViewerRpcReply): void {
    const { reply } = answer;
    if (!reply || reply.ok) return;
    this.log.line(`${reply.error?.message ?? "refused"} ${reply.error?.hint ?? ""}`.trim(), "error", "rpc-refused");
  }

  private refresh(): void {
    const now = performance.now();
    this.surfaceRate.advance(now);
    this.pictureRate.advance(now);
    const stats = this.stats;
    this.status.refresh(now, stats);
    this.refreshAlarm(stats);
    if (document.body.classList.contains("bare")) return;
    this.refreshGauges(stats);
    this.refreshStream(stats);
    if (!stats) return;
    this.refreshStages(stats);
    this.refreshBodies(stats);
    this.refreshTools(stats);
  }

  /** Shows the worst problem of all bodies in the header, even while the numbers are hidden. */
  private refreshAlarm(stats: Stats | null): void {
    const found = (stats?.bodies ?? []).flatMap((body) => troubles(body).filter((trouble) => trouble.short).map((trouble) => `${body.bodyId} ${trouble.short}`));
    const pill = this.at("alarm");
    pill.hidden = found.length === 0;
    if (found.length > 0) setText(pill, found.length > 1 ? `${found[0]}, and ${found.length - 1} more` : found[0]);
    pill.title = found.join("\n");
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
      [(stats?.simTimeS ?? NaN) >= 0 ? stats!.simTimeS.toFixed(2) : "–", "s", "simulated"],
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
    setRows(this.at("bodies"), stats.bodies.flatMap((body) => bodyRows(body)));
  }

  private refreshTools(stats: Stats): void {
    const rows: Row[] = stats.tools.flatMap((tool) => {
      const drawn = this.feltToDrawnMs(tool);
      const felt = [
        tool.contactRateHz > 0 ? `${short(tool.contactRateHz)} Hz` : "",
        tool.contactAgeMs > 0 ? `${short(tool.contactAgeMs)} ms old` : "",
        Number.isFinite(drawn) ? `drawn ${short(drawn)} ms later` : "",
      ].filter(Boolean).join(" · ");
      const holder = tool.name || (tool.owner !== tool.toolId ? tool.owner : "");
      const force: Row = [holder ? `${tool.toolId} · ${holder}` : tool.toolId, `${short(tool.forceN)} N`, "", "force of the tissue on the tool"];
      const rest: Row = ["", felt, "words", "contact models per second, their age in the haptic device, and time from the hand at a pose, where it is felt, to the picture of it"];
      return felt ? [force, rest] : [force];
    });
    setRows(this.at("tools"), rows.length > 0 ? rows : [["none", ""]]);
  }

  /** Time from the moment at which a hand was at a pose to the picture that shows it [ms]. NaN: not known. */
  feltToDrawnMs(tool: ToolStats): number {
    return tool.poseAgeMs > 0 ? tool.poseAgeMs + Math.max(0, this.latency.value) : NaN;
  }

  private refreshStream(stats: Stats | null): void {
    const rows: Row[] = [
      ["round trip to the viewer", `${short(this.relay.roundTripMs)} ms`],
      ["pages open here", `${this.relay.browsers}`],
      ["viewers on the server", `${stats?.surfaceSubscribers ?? "–"}`],
      ["tools held by people", `${stats?.hapticClients ?? "–"}`],
      ["frames skipped here", count(this.relay.framesDropped)],
      ["cut commands applied", `${stats?.cutsApplied ?? "–"}`],
    ];
    for (const body of stats?.bodies ?? []) {
      rows.push([`${body.bodyId}: topology version`, `${body.epoch}`, "", "Rises whenever a cut or a reset changes the surface (epoch)"]);
      rows.push([`${body.bodyId}: node copies`, count(body.copies), "", "Three unknowns each; a cut adds copies of the nodes beside it"]);
    }
    const refused = stats?.refused.filter((counter) => counter.count > 0n) ?? [];
    for (const counter of refused) rows.push([`messages refused: ${counter.name}`, count(Number(counter.count)), "bad"]);
    setRows(this.at("stream"), rows);
  }
}

function bodyRows(body: BodyStats): Row[] {
  const found = troubles(body);
  const missed = found.some((trouble) => trouble.kind === "error");
  const goal = body.tolerance > 0 ? ` of ${exponent(body.tolerance)}` : "";
  const rows: Row[] = [
    [body.bodyId, body.volumeM3 > 0 ? volume(body.volumeM3) : "", "title", "name and volume at rest"],
    ["elements", count(body.pieces || body.elements), "", "pieces of elements, where cuts divide them"],
    ["solver", `${body.iterations} iterations${body.fixedIterations ? " (fixed)" : ""}`],
    ["residual", `${exponent(body.residual)}${goal}`, missed ? "bad" : "", "relative residual after the step, and the tolerance of the scene"],
  ];
  for (const trouble of found) rows.push(["", trouble.words, "bad words"]);
  return rows;
}

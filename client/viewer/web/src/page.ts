// The parts of the page, and the path of a message through them.

import { Relay } from "./relay";
import { Stage } from "./stage";
import { BodySurface } from "./body";
import { ToolVisual } from "./tool";
import { Hand } from "./hand";
import { Panel } from "./panel";
import { Bar } from "./bar";
import { Colours } from "./colours";
import { Curves } from "./curves";
import { Forces } from "./forces";
import { Gizmo } from "./gizmo";
import { Headset } from "./headset";
import { Help } from "./help";
import { Obstacles } from "./obstacles";
import { Overlays } from "./overlays";
import { Params } from "./params";
import { People } from "./people";
import { Recording } from "./record";
import { Probes } from "./probes";
import { View } from "./view";
import { exposeHooks } from "./hooks";
import type { Session } from "./session";
import type { BodyInfo, SessionInfo, TextureReply } from "../gen/scindo/v1/server_pb";
import type { ViewerDown } from "../gen/scindo/v1/viewer_pb";

export function start(canvas: HTMLCanvasElement): void {
  const page = new Page(canvas);
  page.run();
}

class Page {
  private readonly session: Session = {
    bodies: new Map(), tools: new Map(), toolId: "", clientId: "", readOnly: false, operator: false, paused: false,
  };
  /** Bodies of earlier scenes that the present one does not have. */
  private readonly gone = new Set<string>();
  private readonly relay = new Relay((message, bytes) => this.receive(message, bytes), (open) => this.panel.showConnection(open));
  private readonly stage: Stage;
  private readonly panel = new Panel(this.relay);
  private readonly hand: Hand;
  private readonly bar: Bar;
  private readonly view: View;
  private readonly params = new Params(this.relay, this.session);
  private readonly people = new People(this.session, this.relay);
  private readonly record = new Recording(this.session, this.relay);
  private readonly colours: Colours;
  private readonly curves = new Curves();
  private readonly forces: Forces;
  private readonly overlays: Overlays;
  private readonly obstacles: Obstacles;
  private readonly probes: Probes;
  private readonly gizmo: Gizmo;
  private readonly headset: Headset;

  constructor(canvas: HTMLCanvasElement) {
    this.stage = new Stage(canvas);
    this.hand = new Hand(canvas, this.stage, this.session, this.relay);
    this.colours = new Colours(this.session, () => this.view.ask());
    this.overlays = new Overlays(this.stage, this.session);
    this.obstacles = new Obstacles(this.stage);
    this.probes = new Probes(this.stage);
    this.forces = new Forces(this.stage);
    this.gizmo = new Gizmo(this.stage);
    const { colours, overlays, probes, curves, forces, gizmo } = this;
    this.view = new View(this.stage, this.session, this.relay, { colours, overlays, probes, curves, forces, gizmo });
    this.bar = new Bar(this.stage, this.session, this.relay, this.hand, this.view, new Help());
    const place = () => this.place();
    this.headset = new Headset({ session: this.session, stage: this.stage, relay: this.relay, place }, (words) => this.panel.log.line(words, "error"));
    this.view.onOpen = () => this.params.ask();
    this.people.onChange = () => this.nameTools();
    this.stage.onPicture = () => this.gizmo.place();
  }

  run(): void {
    exposeHooks(this.session, this.stage, this.relay, this.hand, this.panel, this.curves, this.forces, this.people, this.headset);
    requestAnimationFrame((now) => this.frame(now));
    this.relay.open();
  }

  /** Applies one message. Nothing is drawn here, so a burst of messages costs only one picture. */
  private receive(message: ViewerDown["message"], bytes: number): void {
    switch (message.case) {
      case "hello":
        this.session.clientId = message.value.clientId;
        this.session.toolId = message.value.toolId;
        this.session.readOnly = message.value.readOnly;
        this.session.operator = message.value.operator;
        this.panel.showHello(message.value);
        this.bar.refresh();
        this.record.refresh();
        this.view.ask(true);
        this.people.tell();
        break;
      case "people": this.people.setPages(message.value.people); break;
      case "link":
        if (!message.value.connected) this.hand.drop();
        this.panel.showLink(message.value);
        break;
      case "info": this.takeInfo(message.value); break;
      case "plan": this.panel.showPlan(message.value); break;
      case "topology":
        if (!this.belongs(message.value.bodyId)) break;
        this.bodyOf(message.value.bodyId).setTopology(message.value);
        this.bar.refresh();
        break;
      case "texture": void this.takeTexture(message.value); break;
      case "frame":
        if (!this.belongs(message.value.bodyId)) break;
        if (this.bodyOf(message.value.bodyId).setFrame(message.value)) this.stage.invalidate();
        this.panel.countFrame(message.value, bytes);
        break;
      case "field":
        this.session.bodies.get(message.value.bodyId)?.setField(message.value);
        this.stage.invalidate();
        break;
      case "measures":
        this.probes.take(message.value);
        this.curves.measures(message.value);
        break;
      case "forces":
        this.forces.take(message.value);
        this.curves.contacts(message.value);
        break;
      case "tool":
        this.toolOf(message.value.toolId).update(message.value);
        this.nameTool(this.toolOf(message.value.toolId));
        this.curves.tool(message.value);
        this.stage.invalidate();
        break;
      case "toolGone": this.forgetTool(message.value.toolId); break;
      case "stats":
        this.session.paused = message.value.paused;
        this.panel.showStats(message.value);
        this.colours.setStats(message.value);
        this.curves.stats(message.value);
        this.people.setStats(message.value);
        this.record.setStats(message.value);
        this.bar.refresh();
        break;
      case "event": this.panel.event(message.value); break;
      case "rpc":
        this.panel.showRpc(message.value);
        if (message.value.state) this.record.take(message.value.state);
        else this.record.refresh();
        if (message.value.params) this.params.showParams(message.value.params);
        if (message.value.scenes) this.params.showScenes(message.value.scenes);
        break;
    }
  }

  /** Draws one picture: surfaces to the GPU, tools in place, camera, render. */
  private frame(now: number): void {
    requestAnimationFrame((next) => this.frame(next));
    // The headset draws its own pictures.
    if (this.headset.isOn) return;
    this.hand.advance(now);
    this.stage.advance();
    if (!this.stage.takeDirty()) return;
    this.place();
    this.hand.place();
    this.stage.render();
    this.panel.countPicture(now);
  }

  /** Brings everything in the picture to its newest state. */
  private place(): void {
    for (const body of this.session.bodies.values()) body.upload();
    this.colours.advance();
    this.stage.frameBodies(this.session.bodies.values());
    this.obstacles.place();
    for (const tool of this.session.tools.values()) tool.place(this.stage);
    this.overlays.place();
    this.probes.place();
    this.forces.place();
  }

  /** Takes over a scene, new or restarted. Bodies and tools that it does not have are removed. */
  private takeInfo(info: SessionInfo): void {
    const tools = info.tools.map((tool) => tool.id);
    [...this.session.tools.keys()].filter((id) => !tools.includes(id)).forEach((id) => this.forgetTool(id));
    this.curves.restart();
    this.forces.restart();
    this.panel.showInfo(info);
    this.record.setAllowed(info.records);
    this.params.setScene(info.scene);
    if (this.view.isOpen) this.params.ask();
    this.stage.setUp(info.up);
    const ids = info.bodies.map((body) => body.id);
    ids.forEach((id) => this.gone.delete(id));
    for (const [id, body] of this.session.bodies) {
      if (ids.includes(id)) continue;
      this.overlays.undress(body);
      body.dispose();
      this.session.bodies.delete(id);
      this.gone.add(id);
    }
    if (![...this.session.bodies.keys()].some((id) => ids.includes(id))) this.stage.forget();
    info.bodies.forEach((body) => this.takeLook(body));
    this.obstacles.take(info.obstacles);
    this.stage.invalidate();
  }

  private takeLook({ id, look }: BodyInfo): void {
    const layers = look?.layers.map(({ depthM, colour }) => ({ depthM, colour })) ?? [];
    this.bodyOf(id).setLook({ colour: look?.colour, opacity: look?.opacity ?? 1, textured: look?.textured ?? false, layers });
  }

  /** Decodes the image on a body. Textures of WebGL begin at the lower left corner, images at the upper left one. */
  private async takeTexture({ bodyId, mediaType, image }: TextureReply): Promise<void> {
    try {
      const file = new Blob([image as Uint8Array<ArrayBuffer>], { type: mediaType });
      const bitmap = await createImageBitmap(file, { imageOrientation: "flipY", premultiplyAlpha: "none" });
      if (!this.belongs(bodyId)) return;
      this.bodyOf(bodyId).setTexture(bitmap);
      this.stage.invalidate();
    } catch (error) {
      this.panel.log.line(`the image on ${bodyId} cannot be shown: ${String(error)}`, "error");
    }
  }

  /** Whether a body may belong to the scene. A late message may still speak of the scene before it. */
  private belongs(id: string): boolean {
    return !this.gone.has(id);
  }

  private bodyOf(id: string): BodySurface {
    let body = this.session.bodies.get(id);
    if (!body) {
      body = new BodySurface(id, this.session.bodies.size);
      this.session.bodies.set(id, body);
      this.colours.dress(body);
      this.overlays.dress(body);
      this.stage.scene.add(body.object);
    }
    return body;
  }

  private toolOf(id: string): ToolVisual {
    let tool = this.session.tools.get(id);
    if (!tool) {
      tool = new ToolVisual(id, id === this.session.toolId || id === `${this.session.toolId}-left`);
      this.session.tools.set(id, tool);
      this.stage.scene.add(tool.object);
    }
    return tool;
  }

  private nameTools(): void {
    this.session.tools.forEach((tool) => this.nameTool(tool));
    this.stage.invalidate();
  }

  private nameTool(tool: ToolVisual): void {
    const holder = tool.state?.owner ? this.people.holderOf(tool.state.owner) : null;
    tool.setHolder(holder?.name || holder?.id || "", holder?.colour ?? "");
  }

  private forgetTool(id: string): void {
    this.session.tools.get(id)?.dispose();
    this.session.tools.delete(id);
    this.curves.toolGone(id);
    this.stage.invalidate();
  }
}

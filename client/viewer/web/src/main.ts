// The page: messages come in, bodies and tools are kept, a frame is drawn when something changed.

import { Relay } from "./relay";
import { Stage } from "./stage";
import { BodySurface } from "./body";
import { ToolVisual } from "./tool";
import { Hand } from "./hand";
import { Panel } from "./panel";
import { Bar } from "./bar";
import { exposeHooks } from "./hooks";
import type { Session } from "./session";
import type { ViewerDown } from "../gen/scindo/v1/viewer_pb";

const canvas = document.getElementById("view") as HTMLCanvasElement;
const session: Session = {
  bodies: new Map(), tools: new Map(), toolId: "", clientId: "", readOnly: false, paused: false,
};
const relay = new Relay(receive, (state) => panel.showConnection(state));
const stage = new Stage(canvas);
const panel = new Panel(relay);
const hand = new Hand(canvas, stage, session, relay);
const bar = new Bar(stage, session, relay, hand);

/** Applies one message. Nothing is drawn here: a burst of messages costs one picture. */
function receive(message: ViewerDown["message"], bytes: number): void {
  switch (message.case) {
    case "hello":
      session.clientId = message.value.clientId;
      session.toolId = message.value.toolId;
      session.readOnly = message.value.readOnly;
      panel.showHello(message.value);
      bar.refresh();
      break;
    case "link":
      if (!message.value.connected) hand.drop();
      panel.showLink(message.value);
      break;
    case "info":
      panel.showInfo(message.value);
      keepOnly(message.value.bodies.map((body) => body.id));
      break;
    case "plan": panel.showPlan(message.value); break;
    case "topology": bodyOf(message.value.bodyId).setTopology(message.value); break;
    case "frame":
      if (bodyOf(message.value.bodyId).setFrame(message.value)) stage.invalidate();
      panel.countFrame(message.value, bytes);
      break;
    case "tool": {
      const tool = toolOf(message.value.toolId);
      tool.update(message.value);
      stage.invalidate();
      break;
    }
    case "toolGone": forgetTool(message.value.toolId); break;
    case "stats":
      session.paused = message.value.paused;
      panel.showStats(message.value);
      bar.refresh();
      break;
    case "event": panel.log(message.value); break;
    case "rpc": panel.showRpc(message.value); break;
  }
}

/** One picture: surfaces to the GPU, tools in place, camera, render. */
function frame(now: number): void {
  requestAnimationFrame(frame);
  hand.advance(now);
  stage.advance();
  if (!stage.takeDirty()) return;
  for (const body of session.bodies.values()) body.upload();
  stage.frameBodies(session.bodies.values());
  for (const tool of session.tools.values()) tool.place(stage);
  hand.place();
  stage.render();
  panel.countPicture(now);
}

function bodyOf(id: string): BodySurface {
  let body = session.bodies.get(id);
  if (!body) {
    body = new BodySurface(id, session.bodies.size);
    session.bodies.set(id, body);
    stage.scene.add(body.object);
  }
  return body;
}

function toolOf(id: string): ToolVisual {
  let tool = session.tools.get(id);
  if (!tool) {
    tool = new ToolVisual(id, id === session.toolId);
    session.tools.set(id, tool);
    stage.scene.add(tool.object);
  }
  return tool;
}

function forgetTool(id: string): void {
  session.tools.get(id)?.dispose();
  session.tools.delete(id);
  stage.invalidate();
}

/** A server that came back with another scene: bodies it does not know leave the picture. */
function keepOnly(ids: string[]): void {
  for (const [id, body] of session.bodies) {
    if (ids.includes(id)) continue;
    body.dispose();
    session.bodies.delete(id);
  }
  stage.invalidate();
}

exposeHooks(session, stage, relay, hand, panel);
requestAnimationFrame(frame);
relay.open();

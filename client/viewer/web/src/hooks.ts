// `window.scindo`: queries and actions for headless tests (or a curious console).

import { Vector3 } from "three";
import { boundsOf, type Stage } from "./stage";
import type { Curves } from "./curves";
import type { Forces } from "./forces";
import type { Hand, HandMode } from "./hand";
import type { Headset } from "./headset";
import type { Panel } from "./panel";
import type { People } from "./people";
import type { Relay } from "./relay";
import type { Session } from "./session";

type Triple = [number, number, number];

export function exposeHooks(session: Session, stage: Stage, relay: Relay, hand: Hand, panel: Panel, curves: Curves, forces: Forces, people: People, headset: Headset): void {
  const bodies = () => [...session.bodies.values()];
  const hooks = {
    /** Counters since the page opened. */
    counts: () => ({
      messages: relay.messages,
      bytes: relay.bytes,
      frames: panel.surfaceRate.total,
      pictures: stage.pictures,
      unmatched: bodies().reduce((sum, body) => sum + body.unmatched, 0),
    }),
    rates: () => ({ surfaceHz: panel.surfaceRate.value, fps: panel.pictureRate.value, latencyMs: panel.latency.value }),
    feltToDrawnMs: () => Object.fromEntries((panel.stats?.tools ?? []).map((tool) => [tool.toolId, panel.feltToDrawnMs(tool)])),
    bodies: () => bodies().map((body) => ({
      id: body.id,
      epoch: body.epoch,
      vertices: body.vertexCount,
      triangles: body.triangleCount,
      lipTriangles: body.lipTriangles,
      marks: body.marks.count,
      simTimeS: body.simTimeS,
      simStep: Number(body.simStep),
      min: body.bounds.min.toArray() as Triple,
      max: body.bounds.max.toArray() as Triple,
      isHeld: body.isHeld,
      heldVertices: body.heldVertices.length,
      parts: body.render ? body.parts.area.length : 0,
      rest: body.rest.length / 3,
      stressPa: body.stress?.epoch === body.epoch ? Math.max(...body.stress.values) : null,
      colour: body.tissue.skin.color.getHex(),
      opacity: body.tissue.skin.opacity,
      textured: body.tissue.skin.map !== null,
    })),
    /** A copy of a body's surface positions [m], x y z interleaved. */
    positions: (id: string) => Array.from(session.bodies.get(id)?.positions ?? []),
    /** Area of all lips of a body [m²]. */
    lipArea: (id: string) => lips(session, id).reduce((sum, lip) => sum + lip.area, 0),
    /** Centres of all lip triangles of a body [m], x y z interleaved. */
    lipCenters: (id: string) => lips(session, id).flatMap((lip) => lip.center),
    bounds: () => {
      const box = boundsOf(bodies());
      return { min: box.min.toArray() as Triple, max: box.max.toArray() as Triple };
    },
    tools: () => [...session.tools.values()].map((tool) => ({
      id: tool.id,
      own: tool.own,
      mode: tool.state?.mode ?? 0,
      owner: tool.state?.owner ?? "",
      forceN: tool.force.toArray() as Triple,
      closed: tool.state?.closed ?? 0,
      isLimited: tool.isLimited,
      holder: tool.holder,
      held: tool.heldPoint?.toArray() ?? null,
      position: [tool.object.children[0].position.x, tool.object.children[0].position.y, tool.object.children[0].position.z] as Triple,
    })),
    /** Force on this page's own tool [N]. */
    contactForceN: () => session.tools.get(session.toolId)?.force.length() ?? 0,
    /** The surface point under a point of the page, or null. */
    surfaceAt: (x: number, y: number) => {
      const hit = hand.surfaceAt(x, y);
      return hit && { body: hit.body.id, point: hit.point.toArray() as Triple, normal: hit.normal.toArray() as Triple, tag: hit.tag };
    },
    renderer: () => (stage.software ? "software" : "hardware"),
    stats: () => panel.stats,
    /** Whether an effect is active in the server's plan. */
    effectIsOn: (name: string) => panel.plan?.effects.some((effect) => effect.name === name && effect.on) ?? false,
    connected: () => relay.isOpen,
    paused: () => session.paused,
    /** Projects a world point to page pixels. */
    project: (point: Triple) => stage.project(new Vector3(...point)),
    camera: (position: Triple, target: Triple) => {
      stage.release();
      stage.camera.position.set(...position);
      stage.controls.target.set(...target);
      stage.controls.update();
      stage.invalidate();
    },
    cameraState: () => ({
      position: stage.camera.position.toArray() as Triple,
      target: stage.controls.target.toArray() as Triple,
      up: stage.camera.up.toArray() as Triple,
      radius: stage.radius,
    }),
    /** Number of points of each curve while the curves are shown. */
    curves: () => curves.counts,
    /** Contact forces while their arrows are shown: pairs and arrows. */
    forces: () => forces.shown,
    /** What the headset shows, or null outside of it. */
    headset: () => headset.room && {
      pictures: headset.room.pictures,
      hands: headset.room.controllers.map(({ left, grip, tip, pulses }) => ({ left, grip, pulses, tip: tip.toArray() as Triple })),
    },
    /** Who is here, as the page lists them. */
    people: () => people.list,
    /** Changes a live parameter; key and value are as in a scene. */
    set: (key: string, value: string) => relay.call({ case: "set", value: { key, value } }),
    hand: (mode: HandMode) => hand.choose(mode),
    depth: (part: number) => hand.setDepth(part),
    turn: () => hand.turn(),
    keepClosed: (kept: boolean) => hand.keepClosed(kept),
  };
  Object.assign(window, { scindo: hooks });
}

function lips(session: Session, id: string): { area: number; center: Triple }[] {
  const body = session.bodies.get(id);
  if (!body?.render) return [];
  const { index, source, skinTriangles } = body.render;
  const at = (c: number) => new Vector3().fromArray(body.positions, 3 * source[index[c]]);
  const lips = [];
  for (let c = 3 * skinTriangles; c < index.length; c += 3) {
    const [p, q, r] = [at(c), at(c + 1), at(c + 2)];
    const center = p.clone().add(q).add(r).divideScalar(3).toArray() as Triple;
    lips.push({ area: 0.5 * q.sub(p).cross(r.sub(p)).length(), center });
  }
  return lips;
}

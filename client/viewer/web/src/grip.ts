// What a hand holds: the shapes of tools, as fractions of the scene's radius, and the message that moves them.

import { create } from "@bufbuild/protobuf";
import type { Quaternion, Vector3 } from "three";
import { PoseSchema, Vec3Schema } from "../gen/scindo/v1/common_pb";
import { ToolSampleSchema, ToolShapeSchema, type ToolSample, type ToolSample_Mode, type ToolShape } from "../gen/scindo/v1/tool_pb";

export type Grip = "poke" | "grab" | "cut" | "forceps";

/** Probe radius and blade length as fractions of the scene's radius. */
export const PROBE = 0.055;
const BLADE = 0.9;
/** Radius, length and opening of the jaws as fractions of the scene's radius; force [N] and friction of the grip. */
const JAWS = { radius: 0.024, length: 0.6, opening: 0.15, gripForceN: 1, friction: 0.8 };

/** Shape of a tool in a scene of radius `r` [m]. */
export function shapeOf(grip: Grip, r: number): ToolShape {
  if (grip === "forceps") {
    const { radius, length, opening, gripForceN, friction } = JAWS;
    const value = { radiusM: radius * r, lengthM: length * r, openingM: opening * r, gripForceN, friction };
    return create(ToolShapeSchema, { kind: { case: "forceps", value } });
  }
  return create(ToolShapeSchema, {
    kind: grip === "cut"
      ? { case: "blade", value: { lengthM: BLADE * r, thicknessM: 0.004 * r } }
      : { case: "sphere", value: { radiusM: PROBE * r } },
  });
}

export interface Held {
  seq: bigint;
  /** Time of the page [ms]. */
  now: number;
  /** Tip and turn of the tool, whose shaft is its +z; velocity of the tip [m/s]. */
  tip: Vector3;
  turn: Quaternion;
  velocity: Vector3;
  mode: ToolSample_Mode;
  shape: ToolShape;
  /** How far forceps are closed, 0 to 1; by the mode if absent. */
  closed?: number;
  /** The page's second tool, for its left hand. */
  left?: boolean;
}

/** The message that moves a tool. Relay and server set the ids. */
export function sampleOf({ seq, now, tip, turn, velocity, mode, shape, closed, left }: Held): ToolSample {
  return create(ToolSampleSchema, {
    seq,
    clientTimeNs: BigInt(Math.round(now * 1e3)) * 1000n,
    pose: create(PoseSchema, {
      positionM: create(Vec3Schema, { x: tip.x, y: tip.y, z: tip.z }),
      qx: turn.x, qy: turn.y, qz: turn.z, qw: turn.w,
    }),
    velocityMS: create(Vec3Schema, { x: velocity.x, y: velocity.y, z: velocity.z }),
    mode,
    shape,
    toolId: left ? "left" : "",
    ...(closed === undefined ? {} : { closed }),
  });
}

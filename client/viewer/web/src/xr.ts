// The scene in a headset: the body lies on a table before the user, and both controllers are hands at its tissue.
// Loaded only when somebody enters it.
//
// A trigger closes: it holds, cuts, or shuts the jaws, as the button of the mouse does. The grip button changes the tool.
// A controller pulses with the force on its tool.

import { Group, PerspectiveCamera, Quaternion, Vector3 } from "three";
import { ToolSample_Mode } from "../gen/scindo/v1/tool_pb";
import { sampleOf, shapeOf, type Grip } from "./grip";
import type { Relay } from "./relay";
import type { Session } from "./session";
import type { Stage } from "./stage";

/** Radius of the scene in the room, and where its centre stands: at a table, within reach [m]. */
const ROOM_RADIUS_M = 0.22;
const PLACE_M = new Vector3(0, 1.05, -0.5);
/** From the controller to the tip of its tool [m]. */
const REACH_M = 0.1;
/** Axes of the room (y up, z towards the user) in those of a scene with z up, seen from its front. */
const ROOM = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), Math.PI / 2);
const GRIPS: Grip[] = ["poke", "grab", "cut", "forceps"];
/** Period of samples [ms]. */
const SAMPLE_MS = 14;
/** Period and length of pulses [ms], and the force of a pulse of half strength [N]. */
const PULSE_MS = 40;
const HALF_N = 1.5;
const PRESSED = 0.5;

/** What entering and leaving needs of the page. */
export interface Host {
  session: Session;
  stage: Stage;
  relay: Relay;
  /** Brings bodies, tools and overlays to their newest state. */
  place: () => void;
  onEnd: () => void;
}

class Controller {
  grip: Grip;
  readonly tip = new Vector3();
  readonly turn = new Quaternion();
  private readonly last = new Vector3();
  private readonly velocity = new Vector3();
  private sent = 0;
  private pulsed = 0;
  private seq = 0n;
  private squeezed = false;
  pulses = 0;
  live = false;

  constructor(readonly left: boolean, readonly object: Group) {
    this.grip = left ? "grab" : "poke";
  }

  /** Reads the buttons: the grip button changes the tool when it goes down. */
  read(source: XRInputSource): number {
    const [trigger, squeeze] = [source.gamepad?.buttons[0]?.value ?? 0, source.gamepad?.buttons[1]?.value ?? 0];
    if (squeeze > PRESSED && !this.squeezed) this.grip = GRIPS[(GRIPS.indexOf(this.grip) + 1) % GRIPS.length];
    this.squeezed = squeeze > PRESSED;
    return trigger;
  }

  /** Sends where the tool is. Its tip lies before the controller, its shaft points back to the hand. */
  send(relay: Relay, radius: number, scale: number, trigger: number, now: number): void {
    this.object.updateWorldMatrix(true, false);
    this.object.getWorldQuaternion(this.turn);
    this.tip.set(0, 0, -1).applyQuaternion(this.turn).multiplyScalar(REACH_M * scale).add(this.object.getWorldPosition(origin));
    const seconds = (now - this.sent) / 1000;
    if (1000 * seconds < SAMPLE_MS) return;
    if (this.sent > 0 && seconds < 0.2) this.velocity.copy(this.tip).sub(this.last).divideScalar(seconds);
    else this.velocity.setScalar(0);
    this.last.copy(this.tip);
    this.sent = now;
    this.seq += 1n;
    const { seq, tip, turn, velocity, left } = this;
    const jaws = this.grip === "forceps" ? { closed: trigger } : {};
    const value = sampleOf({ seq, now, tip, turn, velocity, mode: this.mode(trigger > PRESSED), shape: shapeOf(this.grip, radius), left, ...jaws });
    this.live = relay.send({ case: "tool", value }) || this.live;
  }

  /** Tissue may be pressed without the trigger, as with any rod; a blade without it touches nothing. */
  private mode(pulled: boolean): ToolSample_Mode {
    if (this.grip === "cut") return pulled ? ToolSample_Mode.CUT : ToolSample_Mode.HOVER;
    return pulled && this.grip !== "poke" ? ToolSample_Mode.GRAB : ToolSample_Mode.TOUCH;
  }

  /** Lets the hand feel how large the force is, where a controller can pulse. */
  pulse(source: XRInputSource, newtons: number, now: number): void {
    const actuator = source.gamepad?.hapticActuators?.[0];
    if (!actuator || newtons < 0.01 || now - this.pulsed < PULSE_MS) return;
    this.pulsed = now;
    this.pulses += 1;
    void actuator.pulse(newtons / (newtons + HALF_N), PULSE_MS);
  }
}

const origin = new Vector3();

export class Room {
  readonly camera = new PerspectiveCamera(70, 1, 0.02, 30);
  readonly controllers: Controller[];
  pictures = 0;
  private readonly rig = new Group();

  private constructor(private readonly host: Host, private readonly xr: XRSession) {
    const manager = host.stage.renderer.xr;
    this.controllers = [0, 1].map((index) => {
      const object = manager.getController(index);
      this.rig.add(object);
      return new Controller(index === 0, object);
    });
    this.rig.add(this.camera);
    host.stage.scene.add(this.rig);
  }

  /** Asks for the headset and shows the scene in it. */
  static async enter(host: Host): Promise<Room> {
    const xr = await navigator.xr!.requestSession("immersive-vr", { requiredFeatures: ["local-floor"] });
    const { renderer } = host.stage;
    const room = new Room(host, xr);
    renderer.xr.enabled = true;
    renderer.xr.setReferenceSpaceType("local-floor");
    xr.addEventListener("end", () => room.leave());
    await renderer.xr.setSession(xr);
    renderer.setAnimationLoop((now) => room.frame(now));
    return room;
  }

  end(): void {
    void this.xr.end();
  }

  private leave(): void {
    const { stage, relay } = this.host;
    stage.renderer.setAnimationLoop(null);
    stage.renderer.xr.enabled = false;
    this.rig.removeFromParent();
    for (const controller of this.controllers) {
      if (controller.live) relay.send({ case: "release", value: { left: controller.left } });
    }
    stage.relayout();
    this.host.onEnd();
  }

  private frame(now: number): void {
    const { stage, relay, session } = this.host;
    const scale = this.placeRig();
    for (const source of this.xr.inputSources) {
      const controller = this.controllers.find(({ left }) => left === (source.handedness === "left"));
      if (!controller || session.readOnly) continue;
      // The manager numbers controllers as they connect; the side of the hand decides which tool it moves.
      this.bind(controller, source);
      controller.send(relay, stage.radius, scale, controller.read(source), now);
      const tool = session.tools.get(controller.left ? `${session.toolId}-left` : session.toolId);
      controller.pulse(source, tool?.force.length() ?? 0, now);
    }
    this.host.place();
    stage.renderer.render(stage.scene, this.camera);
    this.pictures += 1;
  }

  /** Puts the pose of an input source on its controller's object. */
  private bind(controller: Controller, source: XRInputSource): void {
    const manager = this.host.stage.renderer.xr;
    const [frame, space] = [manager.getFrame(), manager.getReferenceSpace()];
    const pose = frame && space ? frame.getPose(source.targetRaySpace, space) : null;
    if (!pose) return;
    const { position: p, orientation: q } = pose.transform;
    controller.object.matrixAutoUpdate = true;
    controller.object.position.set(p.x, p.y, p.z);
    controller.object.quaternion.set(q.x, q.y, q.z, q.w);
    controller.object.updateMatrix();
  }

  /** Lays the scene on the table; metres of the scene per metre of the room. */
  private placeRig(): number {
    const { stage } = this.host;
    const scale = stage.radius / ROOM_RADIUS_M;
    this.rig.quaternion.copy(stage.turn).multiply(ROOM);
    this.rig.scale.setScalar(scale);
    this.rig.position.copy(PLACE_M).multiplyScalar(-scale).applyQuaternion(this.rig.quaternion).add(stage.center);
    this.rig.updateMatrixWorld(true);
    return scale;
  }
}

// Optional drawings over the bodies: mesh, held places, and a plane that cuts bodies open. All are off at
// first.

import {
  AlwaysStencilFunc, BackSide, BufferAttribute, BufferGeometry, DecrementWrapStencilOp, DoubleSide, FrontSide, Group,
  IncrementWrapStencilOp, Mesh, MeshBasicMaterial, NotEqualStencilFunc, Plane, PlaneGeometry, Points, PointsMaterial,
  ReplaceStencilOp, Vector3, type Side, type StencilOp,
} from "three";
import type { BodySurface } from "./body";
import type { Session } from "./session";
import type { Stage } from "./stage";

export class Overlays {
  private mesh = false;
  private held = false;
  private clipping = false;
  private axis: "eye" | "x" | "y" | "z" = "eye";
  private part = 0;
  private flip = 1;
  private readonly plane = new Plane();
  private readonly extras = new Map<BodySurface, Extra>();

  constructor(private readonly stage: Stage, private readonly session: Session) {}

  showMesh(on: boolean): void {
    this.mesh = on;
    this.dressAll();
  }

  showHeld(on: boolean): void {
    this.held = on;
    this.dressAll();
  }

  showClip(on: boolean): void {
    this.clipping = on;
    if (on) this.turnPlane();
    this.dressAll();
  }

  /** Sets the normal of the plane: an axis, or the present direction to the viewer. */
  setAxis(axis: "eye" | "x" | "y" | "z"): void {
    this.axis = axis;
    this.turnPlane();
  }

  /** Sets the position of the plane, −1 to 1 across the visible region. */
  setPart(part: number): void {
    this.part = part;
    this.movePlane();
  }

  flipPlane(): void {
    this.flip = -this.flip;
    this.plane.normal.negate();
    this.movePlane();
  }

  /** Applies the active overlays to a new body. */
  dress(body: BodySurface): void {
    this.undress(body);
    body.clip(this.clipping ? [this.plane] : null);
    if (!this.mesh && !this.held && !this.clipping) return;
    const extra = new Extra(body, { mesh: this.mesh, held: this.held, plane: this.clipping ? this.plane : null });
    this.extras.set(body, extra);
    this.stage.scene.add(extra.object);
    body.touch();
  }

  undress(body: BodySurface): void {
    this.extras.get(body)?.dispose();
    this.extras.delete(body);
    body.onUpload = () => {};
  }

  /** Called once per picture. */
  place(): void {
    if (this.clipping) for (const extra of this.extras.values()) extra.place(this.stage.radius);
  }

  private dressAll(): void {
    for (const body of this.session.bodies.values()) this.dress(body);
    this.stage.invalidate();
  }

  private turnPlane(): void {
    const { normal } = this.plane;
    if (this.axis === "eye") normal.copy(this.stage.controls.target).sub(this.stage.camera.position).normalize();
    else normal.set(Number(this.axis === "x"), Number(this.axis === "y"), Number(this.axis === "z"));
    normal.multiplyScalar(this.flip);
    this.movePlane();
  }

  private movePlane(): void {
    const at = this.stage.center.clone().addScaledVector(this.plane.normal, this.flip * this.part * this.stage.radius);
    this.plane.constant = -at.dot(this.plane.normal);
    this.stage.invalidate();
  }
}

/** The overlays of one body. */
class Extra {
  readonly object = new Group();
  private readonly held: Points | null = null;
  private vertices: number[] = [];
  private epoch = -1;
  private cap: Mesh | null = null;
  private readonly materials: { dispose(): void }[] = [];

  constructor(private readonly body: BodySurface, what: { mesh: boolean; held: boolean; plane: Plane | null }) {
    const clip = what.plane ? { clippingPlanes: [what.plane] } : {};
    if (what.mesh) {
      const lines = this.keep(new MeshBasicMaterial({ wireframe: true, color: 0x0b1016, transparent: true, opacity: 0.3, toneMapped: false, polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -1, ...clip }));
      this.add(new Mesh(body.geometry, lines), 1);
    }
    if (what.held) {
      const dots = this.keep(new PointsMaterial({ color: 0x4aa3ff, size: 5, sizeAttenuation: false, toneMapped: false, ...clip }));
      this.held = new Points(new BufferGeometry(), dots);
      this.add(this.held, 2);
      body.onUpload = () => this.follow();
    }
    if (what.plane) this.addCap(what.plane);
  }

  /** Moves held places with the body (their displacement may be prescribed). */
  private follow(): void {
    const { body, held } = this;
    if (!held) return;
    if (this.epoch !== body.epoch) {
      this.epoch = body.epoch;
      this.vertices = body.heldVertices;
      held.geometry.dispose();
      held.geometry = new BufferGeometry();
      held.geometry.setAttribute("position", new BufferAttribute(new Float32Array(3 * this.vertices.length), 3));
    }
    const position = held.geometry.getAttribute("position") as BufferAttribute;
    this.vertices.forEach((v, i) => position.setXYZ(i, body.positions[3 * v], body.positions[3 * v + 1], body.positions[3 * v + 2]));
    position.needsUpdate = true;
  }

  /**
   * Draws the face that the plane makes. Back faces seen beyond the plane count up, front faces count down.
   * Where the count is not zero, the plane lies within the body. The count is cleared after each body.
   */
  private addCap(plane: Plane): void {
    const order = 10 + 3 * this.body.order;
    const count = (side: Side, op: StencilOp) => this.keep(new MeshBasicMaterial({
      side, clippingPlanes: [plane], depthWrite: false, depthTest: false, colorWrite: false,
      stencilWrite: true, stencilFunc: AlwaysStencilFunc, stencilFail: op, stencilZFail: op, stencilZPass: op,
    }));
    this.add(new Mesh(this.body.geometry, count(BackSide, IncrementWrapStencilOp)), order);
    this.add(new Mesh(this.body.geometry, count(FrontSide, DecrementWrapStencilOp)), order);
    const face = this.keep(new MeshBasicMaterial({
      color: this.body.tissue.inside, side: DoubleSide, stencilWrite: true, stencilRef: 0, stencilFunc: NotEqualStencilFunc,
      stencilFail: ReplaceStencilOp, stencilZFail: ReplaceStencilOp, stencilZPass: ReplaceStencilOp,
    }));
    this.cap = new Mesh(new PlaneGeometry(2, 2), face);
    this.cap.onAfterRender = (renderer) => renderer.clearStencil();
    this.cap.userData = { plane };
    this.add(this.cap, order + 1);
  }

  /** Keeps the face in the plane and large enough for the body. */
  place(radius: number): void {
    if (!this.cap) return;
    const plane = this.cap.userData["plane"] as Plane;
    const { min, max } = this.body.bounds;
    plane.projectPoint(min.clone().add(max).multiplyScalar(0.5), this.cap.position);
    this.cap.scale.setScalar(Math.max(radius, min.distanceTo(max)));
    this.cap.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), plane.normal);
  }

  dispose(): void {
    this.object.removeFromParent();
    this.held?.geometry.dispose();
    this.cap?.geometry.dispose();
    for (const material of this.materials) material.dispose();
  }

  private add(object: Mesh | Points, order: number): void {
    object.frustumCulled = false;
    object.renderOrder = order;
    this.object.add(object);
  }

  private keep<M extends { dispose(): void }>(material: M): M {
    this.materials.push(material);
    return material;
  }
}

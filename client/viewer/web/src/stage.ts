// The stage of the bodies: camera, light, and when to draw.

import { ACESFilmicToneMapping, Box3, MathUtils, PCFShadowMap, PerspectiveCamera, Quaternion, Scene, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Backdrop } from "./backdrop";
import { onTheme } from "./theme";
import type { BodySurface } from "./body";

/** Repeated pictures slower than this lower the resolution [ms]. */
const SLOW_PICTURE_MS = 55;
/** The camera follows the bodies when they drift by more than this fraction of their radius. */
const DRIFT = 0.6;

/** Margin around the bodies in view, as a factor. */
const MARGIN = 1.18;

/** Directions of the camera, in axes with z up, x to the right and y away from the front. */
export const PRESETS = { corner: [0.42, -0.8, 0.55], front: [0, -1, 0], right: [1, 0, 0], top: [0, -0.001, 1] } as const;
export type Preset = keyof typeof PRESETS;

/** Width that other elements cover at each side of the picture [page pixels]. */
export interface Insets { left: number; right: number; top: number; bottom: number }

export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(32, 1, 0.001, 10);
  controls: OrbitControls;
  /** Half the diagonal of the bodies in view [m]. All sizes in the scene follow it. */
  radius = 0.1;
  readonly center = new Vector3();
  /** Rotation from axes with z up to those of the scene. */
  readonly turn = new Quaternion();
  pictures = 0;
  /** The processor renders: fewer lamps, coarser shadows, no reflections. */
  readonly software: boolean;
  readonly renderer: WebGLRenderer;
  /** Called after each picture, to update what lies over it. */
  onPicture: () => void = () => {};
  /** Covered margins of the picture, read at every change of layout. */
  insets: () => Insets = () => ({ left: 0, right: 0, top: 0, bottom: 0 });
  /** Whether the address gives `?up=`, which overrides the scene. */
  private readonly upGiven: boolean;
  /** Whether resolution may be lowered for speed. `?quality=full` forbids it, for screenshots. */
  private readonly spares: boolean;
  private readonly backdrop: Backdrop;
  private dirty = true;
  private fitted = false;
  private preset: Preset = "corner";
  /** The box fitted last; null once the user has turned the view. */
  private fittedBox: Box3 | null = null;
  private slow = 0;
  private lastPicture = 0;
  private pixelRatio: number;

  constructor(private readonly canvas: HTMLCanvasElement) {
    const query = new URLSearchParams(location.search);
    this.spares = query.get("quality") !== "full";
    this.software = this.spares && isSoftwareRenderer();
    document.body.classList.toggle("plain", this.software);
    this.pixelRatio = Math.min(devicePixelRatio, this.software ? 0.85 : 2);
    this.renderer = new WebGLRenderer({ canvas, antialias: !this.software, stencil: true, powerPreference: "high-performance" });
    this.renderer.toneMapping = ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.05;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.localClippingEnabled = true;
    this.backdrop = new Backdrop(this.scene, this.renderer, this.software);
    this.controls = this.newControls();
    const up = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] }[query.get("up") ?? ""];
    this.upGiven = up !== undefined;
    this.turnTo(new Vector3(...(up ?? [0, 0, 1])));
    onTheme(() => {
      this.backdrop.follow();
      this.invalidate();
    });
    new ResizeObserver(() => this.relayout()).observe(canvas);
    this.relayout();
  }

  invalidate(): void {
    this.dirty = true;
  }

  takeDirty(): boolean {
    const dirty = this.dirty;
    this.dirty = false;
    return dirty;
  }

  advance(): void {
    this.controls.update();
  }

  render(): void {
    this.renderer.render(this.scene, this.camera);
    this.pictures += 1;
    this.onPicture();
    this.spare(performance.now());
  }

  /** Sets the "up" of the scene, against gravity. */
  setUp(up: { x: number; y: number; z: number } | undefined): void {
    if (this.upGiven || !up) return;
    const wanted = new Vector3(up.x, up.y, up.z);
    if (wanted.lengthSq() < 0.5 || wanted.normalize().distanceTo(this.camera.up) < 1e-6) return;
    this.turnTo(wanted);
    this.fitted = false;
    this.invalidate();
  }

  /** Fits the camera when the first body appears, then follows the bodies when they move away. */
  frameBodies(bodies: Iterable<BodySurface>): void {
    const box = boundsOf(bodies);
    if (box.isEmpty()) return;
    if (!this.fitted) {
      this.fitted = true;
      this.fit(box);
      return;
    }
    const way = box.getCenter(new Vector3()).sub(this.center);
    const far = way.length() - DRIFT * this.radius;
    if (far <= 0) return;
    way.setLength(far);
    this.center.add(way);
    this.fittedBox?.translate(way);
    this.controls.target.add(way);
    this.camera.position.add(way);
    this.backdrop.aim(this.scene, this.turn, this.center, this.radius);
  }

  /** Stops placing the camera: other code places it from now on. */
  release(): void {
    this.fittedBox = null;
  }

  /** Forgets the fitted box, so that the next body is fitted anew. */
  forget(): void {
    this.fitted = false;
  }

  /** Places the camera so that the whole box is visible. */
  fit(box: Box3, preset: Preset = this.preset): void {
    this.preset = preset;
    this.fittedBox = box.clone();
    box.getCenter(this.center);
    this.radius = Math.max(1e-4, 0.5 * box.getSize(new Vector3()).length());
    const from = new Vector3(...PRESETS[preset]).normalize().applyQuaternion(this.turn);
    this.camera.position.copy(this.center).addScaledVector(from, this.distanceFor(box, from));
    this.camera.near = this.radius / 40;
    this.camera.far = this.radius * 60;
    this.controls.target.copy(this.center);
    this.controls.minDistance = this.radius * 0.15;
    this.controls.maxDistance = this.radius * 20;
    this.controls.update();
    this.resize();
    this.backdrop.aim(this.scene, this.turn, this.center, this.radius);
  }

  /** Distance along `from` at which the whole box fits into the free part of the picture [m]. */
  private distanceFor(box: Box3, from: Vector3): number {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const { left, right, top, bottom } = this.insets();
    const tangent = Math.tan(MathUtils.degToRad(this.camera.fov / 2)) / (MARGIN * Math.max(1, h));
    const across = tangent * Math.max(0.25 * w, w - left - right), along = tangent * Math.max(0.25 * h, h - top - bottom);
    const side = this.camera.up.clone().cross(from).normalize(), over = from.clone().cross(side);
    let distance = 0;
    for (let corner = 0; corner < 8; corner++) {
      const at = new Vector3(corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y, corner & 4 ? box.max.z : box.min.z).sub(this.center);
      distance = Math.max(distance, at.dot(from) + Math.max(Math.abs(at.dot(side)) / across, Math.abs(at.dot(over)) / along));
    }
    return Math.max(distance, 0.2 * this.radius);
  }

  /** Turns the view about its centre: `across` about the axis up, `over` towards it [rad]. */
  turnBy(across: number, over: number): void {
    const way = this.camera.position.clone().sub(this.controls.target), up = this.camera.up;
    const polar = way.angleTo(up), wanted = Math.min(Math.PI - 0.02, Math.max(0.02, polar - over));
    way.applyAxisAngle(up.clone().cross(way).normalize(), wanted - polar).applyAxisAngle(up, across);
    this.lookFrom(way);
  }

  /** Multiplies the distance of the camera. */
  zoomBy(factor: number): void {
    const { minDistance, maxDistance, target } = this.controls;
    this.lookFrom(this.camera.position.clone().sub(target).multiplyScalar(factor).clampLength(minDistance, maxDistance));
  }

  private lookFrom(way: Vector3): void {
    this.release();
    this.camera.position.copy(this.controls.target).add(way);
    this.controls.update();
    this.invalidate();
  }

  /** Projects a world point to page pixels, and tells whether it lies before the camera. */
  project(point: Vector3): { x: number; y: number; visible: boolean } {
    const p = point.clone().project(this.camera);
    const { clientWidth: w, clientHeight: h } = this.canvas;
    return { x: ((p.x + 1) / 2) * w, y: ((1 - p.y) / 2) * h, visible: p.z > -1 && p.z < 1 };
  }

  /** Page pixels per metre at the centre of rotation. */
  get pixelsPerMetre(): number {
    const distance = this.camera.position.distanceTo(this.controls.target);
    return this.canvas.clientHeight / (2 * Math.tan(MathUtils.degToRad(this.camera.fov / 2)) * distance);
  }

  /** Called when the covered margins have changed, to keep the bodies in the free part. */
  relayout(): void {
    if (this.fittedBox) this.fit(this.fittedBox);
    else this.resize();
  }

  private resize(): void {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    this.renderer.setPixelRatio(this.pixelRatio);
    this.renderer.setSize(w, h, false);
    this.camera.aspect = w / Math.max(1, h);
    // The bodies stand in the middle of the free part.
    const { left, right, top, bottom } = this.insets();
    this.camera.setViewOffset(w, h, (right - left) / 2, (bottom - top) / 2, w, h);
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  private turnTo(up: Vector3): void {
    this.camera.up.copy(up);
    this.turn.setFromUnitVectors(new Vector3(0, 0, 1), up);
    // The controls keep the "up" with which they were created.
    this.controls.dispose();
    this.controls = this.newControls();
    this.backdrop.aim(this.scene, this.turn, this.center, this.radius);
  }

  private newControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = true;
    controls.dampingFactor = 0.12;
    controls.zoomSpeed = 1.2;
    controls.addEventListener("change", () => this.invalidate());
    controls.addEventListener("start", () => this.release());
    return controls;
  }

  /** Lowers the resolution on a slow machine, then drops shadows, before the picture rate suffers. */
  private spare(now: number): void {
    if (!this.spares) return;
    const took = now - this.lastPicture;
    this.lastPicture = now;
    this.slow = took > SLOW_PICTURE_MS && took < 1500 ? this.slow + 1 : Math.max(0, this.slow - 2);
    if (this.slow < 24) return;
    this.slow = 0;
    if (this.pixelRatio > 0.6) this.pixelRatio = Math.max(0.6, this.pixelRatio * 0.8);
    else this.backdrop.key.castShadow = false;
    this.resize();
  }
}

/**
 * Bounds of the parts of interest: those that hang on something held, or the largest part if nothing is held.
 * Material that a cut frees may fall for ever, so it is left out.
 */
export function boundsOf(bodies: Iterable<BodySurface>): Box3 {
  const shown = [...bodies].filter((body) => body.render !== null && !body.core.isEmpty());
  const box = new Box3();
  const held = shown.filter((body) => body.isHeld);
  for (const body of held) box.union(body.core);
  if (held.length > 0) return box;
  const largest = shown.reduce<BodySurface | null>((most, body) => (most && most.coreArea >= body.coreArea ? most : body), null);
  return largest ? box.copy(largest.core) : box;
}

function isSoftwareRenderer(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

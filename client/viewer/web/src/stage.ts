// Where the bodies lie: camera, lights, ground, background, and when to draw.

import {
  ACESFilmicToneMapping, BackSide, Box3, Color, DirectionalLight, HemisphereLight, MathUtils, Mesh, MeshBasicMaterial,
  PCFShadowMap, PerspectiveCamera, PlaneGeometry, PMREMGenerator, Scene, ShaderMaterial, ShadowMaterial,
  SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { BodySurface } from "./body";

/** Pictures slower than this, again and again, lower the resolution [ms]. */
const SLOW_PICTURE_MS = 55;

export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(32, 1, 0.001, 10);
  readonly controls: OrbitControls;
  /** Half the diagonal of the bodies [m]; everything that has a size is sized by it. */
  radius = 0.1;
  readonly center = new Vector3();
  pictures = 0;
  /** A processor draws: fewer lamps, coarser shadows, no reflections. */
  readonly software: boolean;
  /** Whether resolution may give way to speed; `?quality=full` forbids it, for pictures. */
  private readonly spares: boolean;
  private readonly renderer: WebGLRenderer;
  private readonly key = new DirectionalLight(0xfff1e2, 2.3);
  private readonly ground: Ground;
  private dirty = true;
  private fitted = false;
  private slow = 0;
  private lastPicture = 0;
  private pixelRatio: number;

  constructor(private readonly canvas: HTMLCanvasElement) {
    const query = new URLSearchParams(location.search);
    this.spares = query.get("quality") !== "full";
    this.software = this.spares && isSoftwareRenderer();
    document.body.classList.toggle("plain", this.software);
    this.pixelRatio = Math.min(devicePixelRatio, this.software ? 0.85 : 2);
    this.renderer = new WebGLRenderer({ canvas, antialias: !this.software, powerPreference: "high-performance" });
    this.renderer.toneMapping = ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.05;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    const up = query.get("up");
    if (up === "x") this.camera.up.set(1, 0, 0);
    else if (up !== "y") this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.zoomSpeed = 1.2;
    this.controls.addEventListener("change", () => this.invalidate());
    this.ground = new Ground(this.camera.up);
    this.light();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
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
    this.spare(performance.now());
  }

  /** Fits the camera when the first body has a surface; follows growing bounds with the lights. */
  frameBodies(bodies: Iterable<BodySurface>): void {
    if (this.fitted) return;
    const box = boundsOf(bodies);
    if (box.isEmpty()) return;
    this.fitted = true;
    this.fit(box);
  }

  /** Puts the camera where the whole box is seen, from the front, right and above. */
  fit(box: Box3): void {
    box.getCenter(this.center);
    this.radius = Math.max(1e-4, 0.5 * box.getSize(new Vector3()).length());
    const { up, fov, aspect } = this.camera;
    const half = Math.atan(Math.tan(MathUtils.degToRad(fov / 2)) * Math.min(1, aspect * 0.82));
    const distance = (1.02 * this.radius) / Math.sin(half);
    const side = up.z === 1 ? new Vector3(0.42, -0.8, 0) : up.y === 1 ? new Vector3(0.42, 0, 0.8) : new Vector3(0, 0.42, 0.8);
    const from = side.addScaledVector(up, 0.55).normalize();
    this.camera.position.copy(this.center).addScaledVector(from, distance);
    this.camera.near = this.radius / 40;
    this.camera.far = this.radius * 60;
    this.controls.target.copy(this.center);
    this.controls.minDistance = this.radius * 0.15;
    this.controls.maxDistance = this.radius * 20;
    this.controls.update();
    this.resize();
    this.ground.fit(box, this.radius);
    this.aimLights();
  }

  /** A world point in page pixels and whether it is before the camera. */
  project(point: Vector3): { x: number; y: number; visible: boolean } {
    const p = point.clone().project(this.camera);
    const { clientWidth: w, clientHeight: h } = this.canvas;
    return { x: ((p.x + 1) / 2) * w, y: ((1 - p.y) / 2) * h, visible: p.z > -1 && p.z < 1 };
  }

  private light(): void {
    this.scene.add(sky(), this.ground.object, this.ground.shadow, this.key, this.key.target);
    this.scene.add(new HemisphereLight(0xdfe9f7, 0x59403a, 0.75));
    const rim = new DirectionalLight(0xa9c9ff, 0.9);
    rim.position.set(-0.6, 0.8, 0.35).applyQuaternion(zTo(this.camera.up));
    this.scene.add(rim);
    if (this.software) {
      // Prefiltering reflections takes a processor seconds; a plain second lamp does.
      const fill = new DirectionalLight(0xfff6ee, 0.7);
      fill.position.set(-0.8, -0.6, 0.7).applyQuaternion(zTo(this.camera.up));
      this.scene.add(fill);
    } else {
      this.scene.environment = softboxes(this.renderer, this.camera.up);
      this.scene.environmentIntensity = 0.55;
    }
    this.key.castShadow = true;
    this.key.shadow.mapSize.setScalar(this.software ? 512 : 2048);
    this.key.shadow.radius = 4;
  }

  private aimLights(): void {
    const r = this.radius;
    this.key.position.set(0.55, -0.45, 1.25).applyQuaternion(zTo(this.camera.up)).multiplyScalar(2.2 * r).add(this.center);
    this.key.target.position.copy(this.center);
    const shadow = this.key.shadow;
    Object.assign(shadow.camera, { left: -1.9 * r, right: 1.9 * r, top: 1.9 * r, bottom: -1.9 * r, near: 0.05 * r, far: 8 * r });
    shadow.camera.updateProjectionMatrix();
    shadow.bias = -0.0006;
    shadow.normalBias = 0.012 * r;
  }

  private resize(): void {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    this.renderer.setPixelRatio(this.pixelRatio);
    this.renderer.setSize(w, h, false);
    this.camera.aspect = w / Math.max(1, h);
    // The panel covers the right: the bodies stand in the middle of what is left.
    const covered = w > 760 && !document.body.classList.contains("bare") ? 300 : 0;
    this.camera.setViewOffset(w, h, covered / 2, 0, w, h);
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  relayout(): void {
    this.resize();
  }

  /** A machine that cannot keep up gets fewer pixels, then no shadows, before it gets fewer pictures. */
  private spare(now: number): void {
    if (!this.spares) return;
    const took = now - this.lastPicture;
    this.lastPicture = now;
    this.slow = took > SLOW_PICTURE_MS && took < 1500 ? this.slow + 1 : Math.max(0, this.slow - 2);
    if (this.slow < 24) return;
    this.slow = 0;
    if (this.pixelRatio > 0.6) this.pixelRatio = Math.max(0.6, this.pixelRatio * 0.8);
    else this.key.castShadow = false;
    this.resize();
  }
}

export function boundsOf(bodies: Iterable<BodySurface>): Box3 {
  const box = new Box3();
  for (const body of bodies) if (body.render) box.union(body.bounds);
  return box;
}

function zTo(up: Vector3) {
  return new Mesh().quaternion.setFromUnitVectors(new Vector3(0, 0, 1), up);
}

function isSoftwareRenderer(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/** Background: a quiet vertical gradient in screen space. */
function sky(): Mesh {
  const material = new ShaderMaterial({
    depthWrite: false, depthTest: false, toneMapped: false,
    vertexShader: "varying vec2 at; void main() { at = position.xy; gl_Position = vec4(position.xy, 1.0, 1.0); }",
    fragmentShader: /* glsl */ `varying vec2 at; void main() {
      float y = at.y * 0.5 + 0.5;
      vec3 c = mix(vec3(0.055, 0.067, 0.082), vec3(0.165, 0.195, 0.235), smoothstep(0.0, 1.0, y));
      c *= 1.0 - 0.22 * dot(at * vec2(0.8, 0.6), at * vec2(0.8, 0.6));
      gl_FragColor = vec4(c + (fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) - 0.5) / 255.0, 1.0);
    }`,
  });
  const mesh = new Mesh(new PlaneGeometry(2, 2), material);
  mesh.frustumCulled = false;
  mesh.renderOrder = -2;
  return mesh;
}

/** Reflections: two soft lamps in a dim room, prefiltered once. */
function softboxes(renderer: WebGLRenderer, up: Vector3) {
  const room = new Scene();
  room.add(new Mesh(new SphereGeometry(10, 16, 12), new MeshBasicMaterial({ color: new Color(0.20, 0.22, 0.25), side: BackSide })));
  const lamp = (x: number, y: number, z: number, w: number, h: number, light: number) => {
    const mesh = new Mesh(new PlaneGeometry(w, h), new MeshBasicMaterial({ color: new Color(light, light * 0.97, light * 0.92) }));
    mesh.position.set(x, y, z).applyQuaternion(zTo(up));
    mesh.lookAt(0, 0, 0);
    room.add(mesh);
  };
  lamp(3, -3, 6, 5, 3, 6);
  lamp(-5, 2, 4, 3, 4, 3);
  lamp(0, 7, 1.5, 6, 1, 3);
  const generator = new PMREMGenerator(renderer);
  const texture = generator.fromScene(room, 0.03, 0.1, 40).texture;
  generator.dispose();
  return texture;
}

/** A grid that fades out, with the shadow of the bodies on it. */
class Ground {
  readonly object: Mesh;
  readonly shadow: Mesh;
  private readonly uniforms = { cell: { value: 0.01 }, reach: { value: 1 } };

  constructor(private readonly up: Vector3) {
    const material = new ShaderMaterial({
      uniforms: this.uniforms, transparent: true, depthWrite: false, toneMapped: false,
      vertexShader: "varying vec2 at; void main() { at = position.xy; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
      fragmentShader: /* glsl */ `varying vec2 at; uniform float cell; uniform float reach;
      float lines(float size, float width) {
        vec2 p = at / size; vec2 w = fwidth(p) * width;
        vec2 d = abs(fract(p - 0.5) - 0.5);
        vec2 a = (1.0 - smoothstep(vec2(0.0), w, d)) * clamp(0.6 / (fwidth(p) * 4.0 + 0.001), 0.0, 1.0);
        return max(a.x, a.y);
      }
      void main() {
        float fade = 1.0 - smoothstep(0.1, 0.8, length(at) / reach);
        float a = max(0.09 * lines(cell, 1.2), 0.20 * lines(5.0 * cell, 1.4));
        gl_FragColor = vec4(0.62, 0.70, 0.80, a * fade * fade);
      }`,
    });
    this.object = new Mesh(new PlaneGeometry(1, 1), material);
    this.object.renderOrder = -1;
    this.shadow = new Mesh(new PlaneGeometry(1, 1), new ShadowMaterial({ opacity: 0.42 }));
    this.shadow.receiveShadow = true;
    for (const mesh of [this.object, this.shadow]) {
      mesh.quaternion.copy(zTo(up));
      mesh.visible = false;
    }
  }

  fit(box: Box3, radius: number): void {
    const reach = 5 * radius;
    const low = Math.min(box.min.dot(this.up), box.max.dot(this.up)) - 0.04 * radius;
    const center = box.getCenter(new Vector3());
    center.addScaledVector(this.up, low - center.dot(this.up));
    for (const mesh of [this.object, this.shadow]) {
      mesh.visible = true;
      mesh.position.copy(center);
      mesh.geometry.dispose();
      mesh.geometry = new PlaneGeometry(2 * reach, 2 * reach);
    }
    this.shadow.position.addScaledVector(this.up, -0.001 * radius);
    this.uniforms.reach.value = reach;
    this.uniforms.cell.value = 10 ** Math.round(Math.log10(radius / 8));
  }
}

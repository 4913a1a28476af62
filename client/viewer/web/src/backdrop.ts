// Background and lighting of the scene: backdrop, lamps, reflections.

import {
  BackSide, Color, DirectionalLight, Group, HemisphereLight, Mesh, MeshBasicMaterial, PlaneGeometry, PMREMGenerator, Scene,
  ShaderMaterial, SphereGeometry, type Texture, type Vector3, type WebGLRenderer,
} from "three";
import { isLight } from "./theme";

/** Faint gradients in screen space: bottom and top of the picture, display-referred. */
const SKIES = { dark: [[0.055, 0.067, 0.082], [0.165, 0.195, 0.235]], light: [[0.78, 0.81, 0.84], [0.95, 0.965, 0.975]] };

export class Backdrop {
  readonly key = new DirectionalLight(0xfff1e2, 2.3);
  private readonly rig = new Group();
  private readonly sky = sky();

  /** `software`: the processor renders, so a lamp replaces the reflections. */
  constructor(scene: Scene, renderer: WebGLRenderer, private readonly software: boolean) {
    const lamp = (color: number, intensity: number, x: number, y: number, z: number) => {
      const light = new DirectionalLight(color, intensity);
      light.position.set(x, y, z);
      this.rig.add(light, light.target);
    };
    lamp(0xa9c9ff, 0.9, -0.6, 0.8, 0.35);
    // The underside of a body is visible as well.
    lamp(0xd8dde6, 0.55, 0.3, -0.3, -1);
    if (software) lamp(0xfff6ee, 0.7, -0.8, -0.6, 0.7);
    else {
      scene.environment = softboxes(renderer);
      scene.environmentIntensity = 0.55;
    }
    const dome = new HemisphereLight(0xdfe9f7, 0x6a5450, 0.85);
    dome.position.set(0, 0, 1);
    this.rig.add(dome);
    scene.add(this.sky.mesh, this.rig, this.key, this.key.target);
    this.key.castShadow = true;
    this.key.shadow.mapSize.setScalar(software ? 512 : 2048);
    this.key.shadow.radius = 4;
    this.follow();
  }

  /** Applies the colours of the present theme. */
  follow(): void {
    const [low, high] = isLight() ? SKIES.light : SKIES.dark;
    this.sky.low.value.fromArray(low);
    this.sky.high.value.fromArray(high);
  }

  /** Places the lamps above the scene, against gravity. Shadows cover `radius` around `center`. */
  aim(scene: Scene, turn: Group["quaternion"], center: Vector3, radius: number): void {
    this.rig.quaternion.copy(turn);
    if (!this.software) scene.environmentRotation.setFromQuaternion(turn);
    this.key.position.set(0.55, -0.45, 1.25).applyQuaternion(turn).multiplyScalar(2.2 * radius).add(center);
    this.key.target.position.copy(center);
    const shadow = this.key.shadow, reach = 1.9 * radius;
    Object.assign(shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.05 * radius, far: 8 * radius });
    shadow.camera.updateProjectionMatrix();
    shadow.bias = -0.0006;
    shadow.normalBias = 0.012 * radius;
  }
}

function sky() {
  const low = { value: new Color() }, high = { value: new Color() };
  const material = new ShaderMaterial({
    uniforms: { low, high }, depthWrite: false, depthTest: false, toneMapped: false,
    vertexShader: "varying vec2 at; void main() { at = position.xy; gl_Position = vec4(position.xy, 1.0, 1.0); }",
    fragmentShader: /* glsl */ `varying vec2 at; uniform vec3 low; uniform vec3 high; void main() {
      vec3 c = mix(low, high, smoothstep(0.0, 1.0, at.y * 0.5 + 0.5));
      c *= 1.0 - 0.16 * dot(at * vec2(0.8, 0.6), at * vec2(0.8, 0.6));
      gl_FragColor = vec4(c + (fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) - 0.5) / 255.0, 1.0);
    }`,
  });
  const mesh = new Mesh(new PlaneGeometry(2, 2), material);
  mesh.frustumCulled = false;
  mesh.renderOrder = -2;
  return { mesh, low, high };
}

/** Reflections: soft lamps in a dim room with z up, prefiltered once. */
function softboxes(renderer: WebGLRenderer): Texture {
  const room = new Scene();
  room.add(new Mesh(new SphereGeometry(10, 16, 12), new MeshBasicMaterial({ color: new Color(0.20, 0.22, 0.25), side: BackSide })));
  const lamp = (x: number, y: number, z: number, w: number, h: number, light: number) => {
    const mesh = new Mesh(new PlaneGeometry(w, h), new MeshBasicMaterial({ color: new Color(light, light * 0.97, light * 0.92) }));
    mesh.position.set(x, y, z);
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

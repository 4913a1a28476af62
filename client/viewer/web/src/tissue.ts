// The look of tissue: a moist dielectric over a scattering body. Light that enters comes out red. The
// terminator is therefore warm and soft (wrapped diffuse), and the rim keeps a moist sheen (Fresnel). Inside
// a wound the colour follows the depth below the skin. It starts with a pale rim where the skin is cut. Then
// come layers that darken inwards, where less light enters.

import { Color, DataTexture, DoubleSide, FrontSide, LinearFilter, MeshStandardMaterial, RepeatWrapping, RGBAFormat, SRGBColorSpace, Texture, type Plane } from "three";

/** Skin colours of successive bodies: liver, muscle, kidney, fat, gut. */
const SKIN = [0x8f4038, 0xb5713f, 0x6d4a86, 0xc9a064, 0x4f7f86];
/** Default layers from the rim inwards, with depths as fractions of the body's radius. */
const FLESH: [number, number][] = [[0.012, 0xd98a78], [0.05, 0xb3122f], [0.3, 0x8d0d26]];
const TEXELS = 128;
/** Samples across an image that is seen at a flat angle. */
const ANISOTROPY = 8;

/** The look of a body, as the scene sets it. */
export interface Look {
  colour?: number | undefined;
  opacity: number;
  /** Whether an image belongs on the skin. */
  textured: boolean;
  layers: { depthM: number; colour: number }[];
}

export class Tissue {
  readonly skin: MeshStandardMaterial;
  /**
   * Cut faces are wetter and darker red, clearly different from skin. A wound reflects little of the room.
   */
  readonly lip: MeshStandardMaterial;
  private readonly uniforms = { layers: { value: null as DataTexture | null }, reach: { value: 1 }, dark: { value: 0.02 } };
  private layers: [number, number][] = [];
  private texture: DataTexture | null = null;

  constructor(order: number) {
    this.skin = scattering(new Color(SKIN[order % SKIN.length]), 0.42, 0.7, 1);
    this.lip = scattering(new Color(0xffffff), 0.3, 0.35, 0.3, this.uniforms);
    this.lip.envMapIntensity = 0.55;
    this.setLayers([], 0.1);
  }

  /** `radius`: half the diagonal of the body [m]. */
  setLook(look: Look, order: number, radius: number): void {
    this.skin.color.setHex(look.colour ?? (this.skin.map ? 0xffffff : SKIN[order % SKIN.length]));
    const opacity = look.opacity > 0 ? Math.min(1, look.opacity) : 1;
    for (const material of [this.skin, this.lip]) {
      if (material.transparent !== opacity < 1) material.needsUpdate = true;
      material.transparent = opacity < 1;
      material.opacity = opacity;
    }
    this.setLayers(look.layers.map((layer) => [layer.depthM, layer.colour]), radius);
  }

  /** Shows an image on the skin, which the colour of the look tints; `null` takes it away. Its rows run upwards. */
  setImage(image: ImageBitmap | null): void {
    if (!image && !this.skin.map) return;
    this.skin.map?.dispose();
    this.skin.map = null;
    if (image) {
      const map = new Texture(image);
      map.flipY = false;
      map.colorSpace = SRGBColorSpace;
      map.wrapS = map.wrapT = RepeatWrapping;
      map.anisotropy = ANISOTROPY;
      map.needsUpdate = true;
      this.skin.map = map;
    }
    this.skin.needsUpdate = true;
  }

  /** Clips by planes. The inside of the skin is then visible as well. */
  clip(planes: Plane[] | null): void {
    for (const material of [this.skin, this.lip]) {
      material.clippingPlanes = planes;
      material.side = planes ? DoubleSide : FrontSide;
      material.needsUpdate = true;
    }
  }

  /** Colour at the centre of the body, for faces made by a clipping plane. */
  get inside(): number {
    return this.layers[this.layers.length - 1][1];
  }

  dispose(): void {
    this.skin.map?.dispose();
    this.skin.dispose();
    this.lip.dispose();
    this.texture?.dispose();
  }

  private setLayers(given: [number, number][], radius: number): void {
    this.layers = given.length > 0 ? given : FLESH.map(([part, colour]) => [part * radius, colour]);
    const reach = 1.25 * this.layers[this.layers.length - 1][0];
    this.uniforms.reach.value = reach;
    this.uniforms.dark.value = 0.25 * radius;
    this.texture?.dispose();
    this.texture = ramp(this.layers, reach);
    this.uniforms.layers.value = this.texture;
  }
}

/** Colours by depth, from the skin (0) to `reach`, with slightly soft borders. */
function ramp(layers: [number, number][], reach: number): DataTexture {
  const data = new Uint8Array(4 * TEXELS);
  for (let i = 0; i < TEXELS; i++) {
    const depth = ((i + 0.5) / TEXELS) * reach;
    const colour = (layers.find(([end]) => depth <= end) ?? layers[layers.length - 1])[1];
    data.set([colour >> 16, (colour >> 8) & 255, colour & 255, 255], 4 * i);
  }
  const texture = new DataTexture(data, TEXELS, 1, RGBAFormat);
  texture.colorSpace = SRGBColorSpace;
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

function scattering(
  color: Color, roughness: number, strength: number, sheen: number, wound?: Record<string, { value: unknown }>,
): MeshStandardMaterial {
  const material = new MeshStandardMaterial({ color, roughness, metalness: 0 });
  if (wound) material.defines = { ...material.defines, WOUND: "" };
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, wound ?? {});
    shader.uniforms["scatterStrength"] = { value: strength };
    shader.uniforms["rimSheen"] = { value: sheen };
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\n#ifdef WOUND\nattribute float depth; varying float vDepth;\n#endif")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\n#ifdef WOUND\nvDepth = depth;\n#endif");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", `#include <common>\nuniform float scatterStrength; uniform float rimSheen;\n${WOUND_HEAD}`)
      .replace("#include <color_fragment>", `#include <color_fragment>\n${WOUND_COLOR}`)
      .replace("#include <lights_fragment_end>", `#include <lights_fragment_end>\n${SCATTER}`);
  };
  return material;
}

const WOUND_HEAD = /* glsl */ `
#ifdef WOUND
varying float vDepth; uniform sampler2D layers; uniform float reach; uniform float dark;
#endif
`;

/** The colour of the layer. A cavity gets darker with depth. */
const WOUND_COLOR = /* glsl */ `
#ifdef WOUND
  float cavity = mix(0.42, 1.0, exp(-vDepth / dark));
  diffuseColor.rgb *= texture2D(layers, vec2(clamp(vDepth / reach, 0.0, 1.0), 0.5)).rgb * cavity;
#endif
`;

/** Added after three's lights: `normal` and `geometryViewDir` are in view space there. */
const SCATTER = /* glsl */ `
#if NUM_DIR_LIGHTS > 0
  vec3 scatter = mix(vec3(0.62, 0.13, 0.09), diffuseColor.rgb, 0.6);
  float wrapped = dot(normal, directionalLights[0].direction);
  float glow = smoothstep(-0.75, 0.25, wrapped) * (1.0 - smoothstep(0.1, 0.8, wrapped));
  reflectedLight.indirectDiffuse += scatterStrength * glow * scatter * directionalLights[0].color * 0.11;
#endif
  float rim = pow(1.0 - saturate(dot(normal, geometryViewDir)), 3.5);
  reflectedLight.indirectSpecular += rimSheen * rim * vec3(0.30, 0.22, 0.22) * (0.35 + 0.65 * saturate(normal.y));
`;

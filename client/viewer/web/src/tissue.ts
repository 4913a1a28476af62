// How tissue looks: a moist dielectric over a scattering body. Light that enters comes out red,
// so the terminator is warm and soft (wrapped diffuse), and the rim keeps a moist sheen (Fresnel).

import { Color, MeshStandardMaterial } from "three";

/** Skin tints of successive bodies: liver, muscle, kidney, fat, gut. */
const SKIN = [0x8f4038, 0xa35a48, 0x7a323c, 0xc9a064, 0xb87567];
const SCATTER_RED = new Color(0.62, 0.13, 0.09);

export function skinMaterial(order: number): MeshStandardMaterial {
  return tissue(new Color(SKIN[order % SKIN.length]), 0.42, SCATTER_RED, 0.7, 1);
}

/** Fresh cut faces: wetter, darker red, clearly apart from skin; a wound sees little of the room. */
export function lipMaterial(): MeshStandardMaterial {
  const material = tissue(new Color(0xb3122f), 0.3, new Color(0.7, 0.03, 0.09), 0.5, 0.3);
  material.envMapIntensity = 0.55;
  return material;
}

function tissue(color: Color, roughness: number, scatter: Color, strength: number, sheen: number): MeshStandardMaterial {
  const material = new MeshStandardMaterial({ color, roughness, metalness: 0 });
  material.onBeforeCompile = (shader) => {
    shader.uniforms["scatter"] = { value: scatter };
    shader.uniforms["scatterStrength"] = { value: strength };
    shader.uniforms["rimSheen"] = { value: sheen };
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nuniform vec3 scatter; uniform float scatterStrength; uniform float rimSheen;")
      .replace("#include <lights_fragment_end>", `#include <lights_fragment_end>\n${SCATTER}`);
  };
  return material;
}

/** Added after three's lights: `normal` and `geometryViewDir` are in view space there. */
const SCATTER = /* glsl */ `
#if NUM_DIR_LIGHTS > 0
  float wrapped = dot(normal, directionalLights[0].direction);
  float glow = smoothstep(-0.75, 0.25, wrapped) * (1.0 - smoothstep(0.1, 0.8, wrapped));
  reflectedLight.indirectDiffuse += scatterStrength * glow * scatter * directionalLights[0].color * 0.11;
#endif
  float rim = pow(1.0 - saturate(dot(normal, geometryViewDir)), 3.5);
  reflectedLight.indirectSpecular += rimSheen * rim * vec3(0.30, 0.22, 0.22) * (0.35 + 0.65 * saturate(normal.y));
`;

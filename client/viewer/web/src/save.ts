// Files for the person at the page: the picture, and the surfaces as they are shown.

import { BufferAttribute, BufferGeometry, Color, Mesh, MeshStandardMaterial, Scene } from "three";
import type { BodySurface } from "./body";

/** Offers a file for download under the name of the scene and the time. */
export function offer(blob: Blob, ending: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  const scene = (document.getElementById("scene")!.textContent || "scene").replace(/[^a-z0-9]+/gi, "-");
  link.download = `scindo-${scene}-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}.${ending}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/**
 * Binary glTF of all bodies as they are now: a mesh per body, in metres, skin and lips of cuts with a material each. A
 * vertex for each corner that has a normal of its own, as on the screen.
 */
export async function glb(bodies: Iterable<BodySurface>): Promise<Blob> {
  // A file of its own, loaded when it is first asked for.
  const { GLTFExporter } = await import("three/addons/exporters/GLTFExporter.js");
  const scene = new Scene();
  for (const body of bodies) {
    const mesh = meshOf(body);
    if (mesh) scene.add(mesh);
  }
  try {
    return new Blob([(await new GLTFExporter().parseAsync(scene, { binary: true })) as ArrayBuffer], { type: "model/gltf-binary" });
  } finally {
    scene.traverse((node) => { if (node instanceof Mesh) node.geometry.dispose(); });
  }
}

function meshOf(body: BodySurface): Mesh | null {
  const { render, geometry: drawn } = body;
  if (!render) return null;
  body.upload();
  const geometry = new BufferGeometry(), count = 3 * render.source.length;
  for (const name of ["position", "normal"]) {
    const values = drawn.getAttribute(name).array as Float32Array;
    // The buffers of the screen have reserves.
    geometry.setAttribute(name, new BufferAttribute(values.slice(0, count), 3));
  }
  geometry.setIndex(new BufferAttribute(render.index.slice(), 1));
  const skin = 3 * render.skinTriangles, lips = render.index.length - skin;
  const materials = [material("skin", body.tissue.skin.color, body.tissue.skin.opacity)];
  const { map } = body.tissue.skin;
  if (map && drawn.hasAttribute("uv")) {
    const values = drawn.getAttribute("uv").array as Float32Array;
    geometry.setAttribute("uv", new BufferAttribute(values.slice(0, 2 * render.source.length), 2));
    materials[0].map = map;
  }
  geometry.addGroup(0, skin, 0);
  if (lips > 0) {
    geometry.addGroup(skin, lips, 1);
    materials.push(material("lips", new Color(body.tissue.inside), body.tissue.lip.opacity));
  }
  const mesh = new Mesh(geometry, materials);
  mesh.name = body.id;
  return mesh;
}

function material(name: string, color: Color, opacity: number): MeshStandardMaterial {
  return new MeshStandardMaterial({ name, color, opacity, transparent: opacity < 1, roughness: 0.6, metalness: 0 });
}

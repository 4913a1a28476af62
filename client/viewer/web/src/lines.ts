// Thin dark lines on the skin. They show what a blade has drawn without opening it, and the rims of wounds,
// which remain visible where lips lie close together.

import { DynamicDrawUsage, InstancedInterleavedBuffer, InterleavedBufferAttribute, type Plane } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

/**
 * Lines are moved this fraction of their distance towards the viewer, so that the skin does not hide them.
 */
const LIFT = 1.5e-3;

export class SkinLines {
  readonly object: LineSegments2;
  /** End points [m]: x y z of both ends, per line. */
  positions: Float32Array = new Float32Array(0);
  private readonly geometry = new LineSegmentsGeometry();
  private readonly material: LineMaterial;
  private buffer: InstancedInterleavedBuffer | null = null;

  /** Width [pixels]. */
  constructor(width: number) {
    this.material = new LineMaterial({ color: 0x3d0710, linewidth: width });
    this.material.onBeforeCompile = (shader) => {
      shader.vertexShader = shader.vertexShader.replace(
        "vec4 end = modelViewMatrix * vec4( instanceEnd, 1.0 );",
        `vec4 end = modelViewMatrix * vec4( instanceEnd, 1.0 );
        start.xyz *= ${1 - LIFT}; end.xyz *= ${1 - LIFT};`,
      );
    };
    this.object = new LineSegments2(this.geometry, this.material);
    this.object.frustumCulled = false;
    this.object.visible = false;
  }

  clip(planes: Plane[] | null): void {
    this.material.clippingPlanes = planes;
  }

  get count(): number {
    return this.positions.length / 6;
  }

  take(positions: Float32Array | null): void {
    this.positions = positions ?? new Float32Array(0);
  }

  /** Draws edges of a surface, given as pairs of its vertices. */
  follow(edges: Uint32Array, surface: Float32Array): void {
    if (this.positions.length !== 3 * edges.length) this.positions = new Float32Array(3 * edges.length);
    for (let k = 0; k < edges.length; k++) this.positions.set(surface.subarray(3 * edges[k], 3 * edges[k] + 3), 3 * k);
  }

  /** Sends the lines to the GPU. The buffer grows by half. */
  upload(): void {
    this.object.visible = this.count > 0;
    if (this.count === 0) return;
    if (!this.buffer || this.buffer.array.length < this.positions.length) {
      this.geometry.dispose();
      this.buffer = new InstancedInterleavedBuffer(new Float32Array(6 * Math.ceil(this.count * 1.5)), 6, 1);
      this.buffer.setUsage(DynamicDrawUsage);
      this.geometry.setAttribute("instanceStart", new InterleavedBufferAttribute(this.buffer, 3, 0));
      this.geometry.setAttribute("instanceEnd", new InterleavedBufferAttribute(this.buffer, 3, 3));
    }
    (this.buffer.array as Float32Array).set(this.positions);
    this.buffer.needsUpdate = true;
    this.geometry.instanceCount = this.count;
  }

  dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
  }
}

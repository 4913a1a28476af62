// What a blade has drawn on the surface without opening it: thin dark lines that lie on the skin.

import { DynamicDrawUsage, InstancedInterleavedBuffer, InterleavedBufferAttribute } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

/** Width of a line [pixels]. */
const WIDTH = 2.2;
/** Lines come this share of their distance nearer to the eye, so that the skin below does not hide them. */
const LIFT = 1.5e-3;

export class IncisionMarks {
  readonly object: LineSegments2;
  /** Ends as sent [m]: x y z of both ends, per line. */
  positions: Float32Array = new Float32Array(0);
  private readonly geometry = new LineSegmentsGeometry();
  private readonly material = new LineMaterial({ color: 0x3d0710, linewidth: WIDTH });
  private buffer: InstancedInterleavedBuffer | null = null;

  constructor() {
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

  get count(): number {
    return this.positions.length / 6;
  }

  take(positions: Float32Array | null): void {
    this.positions = positions ?? new Float32Array(0);
  }

  /** Brings the lines to the GPU; the buffer grows by half. */
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

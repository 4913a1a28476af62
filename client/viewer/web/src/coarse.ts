// Frames with 16 bits per coordinate, as the relay sends them.

import { create } from "@bufbuild/protobuf";
import { SurfaceFrameSchema, type SurfaceFrame } from "../gen/scindo/v1/surface_pb";
import type { ViewerFrame } from "../gen/scindo/v1/viewer_pb";

const STEPS = 65535;

/** The frame with positions in single precision. One of a wrong length stays without them, and is not drawn. */
export function fine(coarse: ViewerFrame): SurfaceFrame {
  const frame = coarse.frame ?? create(SurfaceFrameSchema);
  const { positions: bytes } = coarse, count = 3 * frame.vertexCount;
  if (bytes.length !== 2 * count) return frame;
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  const min = [coarse.minX, coarse.minY, coarse.minZ];
  const scale = [coarse.sizeX / STEPS, coarse.sizeY / STEPS, coarse.sizeZ / STEPS];
  const positions = new Float32Array(count);
  for (let i = 0, axis = 0; i < count; i++) {
    positions[i] = min[axis] + scale[axis] * view.getUint16(2 * i, true);
    axis = axis === 2 ? 0 : axis + 1;
  }
  frame.positions = new Uint8Array(positions.buffer);
  return frame;
}

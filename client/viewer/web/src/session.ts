// The state of the session as the page knows it.

import type { BodySurface } from "./body";
import type { ToolVisual } from "./tool";

/** Explains why a page may not pause, reset, undo or change anything. */
export const NO_OPERATOR = "Only operators may change the simulation: pages on the server’s machine, or all pages with --operators all.";

/** Everything that the page knows of the session. All drawing uses it. */
export interface Session {
  bodies: Map<string, BodySurface>;
  tools: Map<string, ToolVisual>;
  toolId: string;
  clientId: string;
  readOnly: boolean;
  /** Whether this page may pause, step, reset, set and load. */
  operator: boolean;
  paused: boolean;
}

// What the page knows.

import type { BodySurface } from "./body";
import type { ToolVisual } from "./tool";

/** Why a page may not pause, reset, undo or change anything. */
export const NO_OPERATOR = "Only operators change the simulation: pages on the server’s machine, or all with --operators all.";

/** All the page knows of the session; what is drawn is drawn from here. */
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

// What the page knows.

import type { BodySurface } from "./body";
import type { ToolVisual } from "./tool";

/** All the page knows of the session; what is drawn is drawn from here. */
export interface Session {
  bodies: Map<string, BodySurface>;
  tools: Map<string, ToolVisual>;
  toolId: string;
  clientId: string;
  readOnly: boolean;
  paused: boolean;
}

// The page: messages come in, bodies and tools are kept, a frame is drawn when something changed.

import { sayNoWebGl } from "./status";
import { start } from "./page";

const canvas = document.getElementById("view") as HTMLCanvasElement;
// Asked on a canvas of its own: a context once made keeps its settings.
if (document.createElement("canvas").getContext("webgl2")) start(canvas);
else sayNoWebGl();

// Entry point of the page: messages come in, bodies and tools are kept, and a picture is drawn when something
// changed.

import { sayNoWebGl } from "./status";
import { start } from "./page";

const canvas = document.getElementById("view") as HTMLCanvasElement;
// Tested on a separate canvas, because a context keeps the settings with which it was created.
if (document.createElement("canvas").getContext("webgl2")) start(canvas);
else sayNoWebGl();

// The directions of the axes and a length scale: a triad and a scale bar beside the picture.

import { Vector3 } from "three";
import type { Stage } from "./stage";
import { ink } from "./theme";

const AXES: [string, Vector3, string][] = [
  ["x", new Vector3(1, 0, 0), "#e0564d"], ["y", new Vector3(0, 1, 0), "#4fa84f"], ["z", new Vector3(0, 0, 1), "#4f86e0"],
];
const REACH = 22;
/** Longest scale bar [pixels]. */
const LONGEST = 110;

export class Gizmo {
  private readonly triad = document.getElementById("triad")!;
  private readonly scale = document.getElementById("scale")!;
  private shown = "";

  constructor(private readonly stage: Stage) {}

  show(on: boolean): void {
    document.getElementById("axes")!.hidden = !on;
    this.shown = "";
  }

  /** Called after each picture. It changes the page only if the view turned. */
  place(): void {
    if (document.getElementById("axes")!.hidden) return;
    const { camera } = this.stage;
    const tips = AXES.map(([name, axis, color]) => {
      const at = axis.clone().transformDirection(camera.matrixWorldInverse);
      return { name, color, x: REACH * at.x, y: -REACH * at.y, z: at.z };
    }).sort((a, b) => a.z - b.z);
    const perMetre = this.stage.pixelsPerMetre;
    const key = tips.map((tip) => `${tip.name}${tip.x.toFixed(1)},${tip.y.toFixed(1)}`).join(" ") + perMetre.toFixed(1);
    if (key === this.shown) return;
    this.shown = key;
    this.triad.innerHTML = tips.map(({ name, color, x, y }) =>
      `<line x2="${x.toFixed(1)}" y2="${y.toFixed(1)}" stroke="${color}" stroke-width="2.5" stroke-linecap="round"/>` +
      `<text x="${(1.28 * x).toFixed(1)}" y="${(1.28 * y + 4).toFixed(1)}" fill="${ink("--ink")}" font-size="11" text-anchor="middle">${name}</text>`).join("");
    const metres = round(LONGEST / perMetre);
    (this.scale.firstElementChild as HTMLElement).style.width = `${(metres * perMetre).toFixed(0)}px`;
    this.scale.lastElementChild!.textContent = words(metres);
  }
}

/** The largest number that is 1, 2 or 5 times a power of ten and not larger than `metres`. */
function round(metres: number): number {
  const power = 10 ** Math.floor(Math.log10(metres));
  return (metres >= 5 * power ? 5 : metres >= 2 * power ? 2 : 1) * power;
}

function words(metres: number): string {
  if (metres >= 1) return `${metres.toFixed(0)} m`;
  if (metres >= 0.01) return `${(100 * metres).toFixed(0)} cm`;
  if (metres >= 0.001) return `${(1000 * metres).toFixed(0)} mm`;
  return `${(1e6 * metres).toPrecision(1)} µm`;
}

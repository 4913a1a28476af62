// The tray that selects what is shown: colours, overlays, curves, camera, picture.

import type { Colours, ColourMode } from "./colours";
import type { Curves } from "./curves";
import type { Forces } from "./forces";
import type { Gizmo } from "./gizmo";
import type { Overlays } from "./overlays";
import type { Probes } from "./probes";
import type { Relay } from "./relay";
import { glb, offer } from "./save";
import type { Session } from "./session";
import type { Insets, Stage } from "./stage";

export class View {
  private readonly tray = document.getElementById("tray")!;
  private readonly at = <E extends HTMLElement>(id: string) => document.getElementById(id) as E;
  private asked = "";
  onOpen: () => void = () => {};

  constructor(
    private readonly stage: Stage,
    private readonly session: Session,
    private readonly relay: Relay,
    private readonly parts: { colours: Colours; overlays: Overlays; probes: Probes; curves: Curves; forces: Forces; gizmo: Gizmo },
  ) {
    const { colours, overlays, probes, curves, forces, gizmo } = parts;
    const select = this.at<HTMLSelectElement>("colour");
    select.onchange = () => {
      colours.choose(select.value as ColourMode);
      // Returns the keyboard to the scene.
      select.blur();
      stage.invalidate();
    };
    this.box("show-mesh", (on) => overlays.showMesh(on));
    this.box("show-held", (on) => overlays.showHeld(on));
    this.box("show-probes", (on) => probes.show(on));
    this.box("show-curves", (on) => curves.show(on));
    this.box("show-forces", (on) => forces.show(on));
    this.box("show-axes", (on) => gizmo.show(on));
    this.box("show-clip", (on) => {
      this.at("clip-row").hidden = !on;
      overlays.showClip(on);
    });
    const axis = this.at<HTMLSelectElement>("clip-axis"), range = this.at<HTMLInputElement>("clip-at");
    axis.onchange = () => {
      overlays.setAxis(axis.value as "eye" | "x" | "y" | "z");
      axis.blur();
    };
    range.oninput = () => overlays.setPart(Number(range.value));
    this.at("clip-flip").onclick = () => overlays.flipPlane();
    this.at("shot").onclick = () => this.savePicture();
    this.at("save-surface").onclick = () => void this.saveSurface();
    stage.insets = () => this.insets();
  }

  get isOpen(): boolean {
    return !this.tray.hidden;
  }

  toggle(open = this.tray.hidden): void {
    this.tray.hidden = !open;
    this.at("view-toggle").setAttribute("aria-pressed", String(open));
    if (open) this.onOpen();
    if (open && innerWidth <= 640) document.body.classList.add("bare");
    this.stage.relayout();
  }

  /** Tells the relay which topics this page shows beside surfaces, if that changed or `anew` is set. */
  ask(anew = false): void {
    const { colours, probes, curves, forces } = this.parts;
    const watch = { stress: colours.mode === "stress", measures: probes.on || curves.on, forces: forces.on || curves.on };
    const words = JSON.stringify(watch);
    if (!anew && words === this.asked) return;
    if (anew && !watch.stress && !watch.measures && !watch.forces) return;
    this.asked = words;
    this.relay.send({ case: "watch", value: watch });
  }

  /** Saves the canvas as a PNG. It is drawn at once, because its buffer is cleared after a picture. */
  savePicture(): void {
    this.stage.render();
    this.at<HTMLCanvasElement>("view").toBlob((blob) => {
      if (blob) offer(blob, "png");
    }, "image/png");
  }

  private async saveSurface(): Promise<void> {
    offer(await glb(this.session.bodies.values()), "glb");
  }

  private box(id: string, set: (on: boolean) => void): void {
    const box = this.at<HTMLInputElement>(id);
    box.onchange = () => {
      set(box.checked);
      this.ask();
      box.blur();
      this.stage.relayout();
    };
  }

  /** Present covered margins of the picture. */
  private insets(): Insets {
    const width = innerWidth, height = innerHeight;
    const over = (id: string) => {
      const box = this.at(id).getBoundingClientRect();
      return box.width > 0 && box.height > 0 ? box : null;
    };
    const panel = over("panel"), foot = over("bar");
    const side = [over("tray"), over("curves")].filter((box) => box !== null);
    if (width <= 640) {
      const top = Math.max(44, ...side.map((box) => box.bottom));
      return { left: 0, right: 0, top, bottom: height - Math.min(panel?.top ?? height, foot?.top ?? height) };
    }
    const left = Math.max(0, ...side.map((box) => box.right));
    const right = panel ? width - panel.left : 0;
    // A window too narrow for both sides keeps the whole width.
    const covers = left + right < 0.7 * width;
    return { left: covers ? left : 0, right: covers ? right : 0, top: 0, bottom: foot ? 0.6 * (height - foot.top) : 0 };
  }
}

// The button that enters a headset. It shows only where the browser has one; the rest loads when it is pressed.

import type { Host, Room } from "./xr";

export class Headset {
  room: Room | null = null;
  private readonly button = document.getElementById("headset") as HTMLButtonElement;

  constructor(private readonly host: Omit<Host, "onEnd">, private readonly say: (words: string) => void) {
    this.button.onclick = () => void this.toggle();
    void this.look();
  }

  get isOn(): boolean {
    return this.room !== null;
  }

  private async look(): Promise<void> {
    this.button.hidden = !(await navigator.xr?.isSessionSupported("immersive-vr").catch(() => false));
  }

  private async toggle(): Promise<void> {
    if (this.room) {
      this.room.end();
      return;
    }
    this.button.disabled = true;
    try {
      const { Room } = await import("./xr");
      this.room = await Room.enter({ ...this.host, onEnd: () => this.ended() });
    } catch (error) {
      this.say(`The headset was not entered: ${error instanceof Error ? error.message : error}`);
    }
    this.button.disabled = false;
    this.button.setAttribute("aria-pressed", String(this.isOn));
  }

  private ended(): void {
    this.room = null;
    this.button.setAttribute("aria-pressed", "false");
  }
}

// The recording on the server's disk, and the present state as a file.

import type { Stats, StateReply } from "../gen/scindo/v1/server_pb";
import type { Relay } from "./relay";
import { offer } from "./save";
import { NO_OPERATOR, type Session } from "./session";

export class Recording {
  /** Whether operators may record here. */
  private allowed = false;
  private file = "";
  private readonly button = document.getElementById("record") as HTMLButtonElement;
  private readonly state = document.getElementById("save-state") as HTMLButtonElement;
  private readonly pill = document.getElementById("recording")!;

  constructor(private readonly session: Session, private readonly relay: Relay) {
    this.button.onclick = () => this.relay.call({ case: "record", value: { on: !this.file } });
    this.state.onclick = () => {
      this.state.disabled = true;
      this.relay.call({ case: "state", value: {} });
    };
    this.refresh();
  }

  setAllowed(allowed: boolean): void {
    this.allowed = allowed;
    this.refresh();
  }

  setStats(stats: Stats): void {
    const { recording } = stats;
    this.file = recording?.file ?? "";
    this.pill.hidden = !recording;
    if (recording) {
      const seconds = Math.floor(recording.seconds);
      this.pill.textContent = `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;
      this.pill.title = `${recording.file} is being recorded, ${size(Number(recording.bytes))} before compression`;
    }
    this.refresh();
  }

  refresh(): void {
    this.button.hidden = !this.allowed;
    this.button.disabled = !this.session.operator;
    this.button.setAttribute("aria-pressed", String(!!this.file));
    this.button.lastElementChild!.textContent = this.file ? "Stop" : "Record";
    this.button.title = !this.session.operator ? NO_OPERATOR : this.file ? `End the recording ${this.file}` : "Record from now on, in the folder of the server";
    this.state.disabled = !this.session.operator;
    this.state.title = this.session.operator ? "Save the present state with its cuts; scindo run --resume goes on from it" : NO_OPERATOR;
  }

  /** Offers the state that the server has sent. */
  take(state: StateReply): void {
    offer(new Blob([state.file as Uint8Array<ArrayBuffer>], { type: "application/octet-stream" }), "mcap");
    this.refresh();
  }
}

function size(bytes: number): string {
  return bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;
}

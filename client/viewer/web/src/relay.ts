// The WebSocket of the page: decoding, reconnection, clock offset, acknowledgement of frames.

import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { ViewerDownSchema, ViewerUpSchema, type ViewerDown } from "../gen/scindo/v1/viewer_pb";
import { fine } from "./coarse";
import type { MessageInitShape } from "@bufbuild/protobuf";

type UpInit = NonNullable<MessageInitShape<typeof ViewerUpSchema>["message"]>;
type RpcCall = NonNullable<Extract<UpInit, { case: "rpc" }>["value"]>["call"];

const RETRY_MS = 700;
const PING_MS = 1000;
/** Number of pings kept. The one with the shortest round trip gives the best clock offset. */
const CLOCK_SAMPLES = 12;

export class Relay {
  /** Number of messages received, of all kinds. */
  messages = 0;
  bytes = 0;
  /** Round trip between page and relay [ms]. */
  roundTripMs = NaN;
  browsers = 0;
  framesDropped = 0;
  private socket: WebSocket | null = null;
  private clock: { roundTripMs: number; offsetMs: number }[] = [];
  private frames = 0;
  private nextCall = 1;

  constructor(
    private readonly receive: (message: ViewerDown["message"], bytes: number) => void,
    private readonly onState: (open: boolean) => void,
  ) {
    setInterval(() => this.send({ case: "ping", value: { pageTimeMs: performance.now() } }), PING_MS);
  }

  get isOpen(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  open(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const path = new URL("ws", location.href).pathname;
    const socket = new WebSocket(`${scheme}://${location.host}${path}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.clock = [];
      this.frames = 0;
      this.onState(true);
      this.send({ case: "ping", value: { pageTimeMs: performance.now() } });
    };
    socket.onmessage = (event) => this.accept(new Uint8Array(event.data as ArrayBuffer));
    socket.onclose = () => {
      this.socket = null;
      this.onState(false);
      setTimeout(() => this.open(), RETRY_MS);
    };
    this.socket = socket;
  }

  send(message: UpInit): boolean {
    if (!this.isOpen) return false;
    const bytes = toBinary(ViewerUpSchema, create(ViewerUpSchema, { message }));
    this.socket!.send(bytes as Uint8Array<ArrayBuffer>);
    return true;
  }

  /** Sends a call to the server. The answer appears as a line of the log. */
  call(call: NonNullable<RpcCall>): void {
    this.send({ case: "rpc", value: { callId: this.nextCall++, call } });
  }

  /** Age of a server time stamp by the relay's clock [ms]; NaN before the first ping. */
  ageMs(publishUnixNs: bigint): number {
    if (this.clock.length === 0) return NaN;
    const best = this.clock.reduce((a, b) => (b.roundTripMs < a.roundTripMs ? b : a));
    return performance.now() + best.offsetMs - Number(publishUnixNs / 1000n) / 1000;
  }

  private accept(bytes: Uint8Array): void {
    this.messages += 1;
    this.bytes += bytes.length;
    let down: ViewerDown;
    try {
      down = fromBinary(ViewerDownSchema, bytes);
    } catch (error) {
      console.error("unreadable message", error);
      return;
    }
    if (down.message.case === "pong") this.setClock(down.message.value);
    const isFrame = down.message.case === "frame" || down.message.case === "coarseFrame";
    this.receive(down.message.case === "coarseFrame" ? { case: "frame", value: fine(down.message.value) } : down.message, bytes.length);
    if (isFrame) {
      this.frames += 1;
      this.send({ case: "frameAck", value: { frames: BigInt(this.frames) } });
    }
  }

  private setClock(pong: { pageTimeMs: number; relayUnixNs: bigint; browsers: number; framesDropped: bigint }): void {
    const now = performance.now();
    this.roundTripMs = now - pong.pageTimeMs;
    this.browsers = pong.browsers;
    this.framesDropped = Number(pong.framesDropped);
    const middle = (now + pong.pageTimeMs) / 2;
    this.clock.push({ roundTripMs: this.roundTripMs, offsetMs: Number(pong.relayUnixNs / 1000n) / 1000 - middle });
    if (this.clock.length > CLOCK_SAMPLES) this.clock.shift();
  }
}

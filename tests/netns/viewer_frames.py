"""A browser's WebSocket in eighty lines: counts the surface frames that scindo-view relays.

    python tests/netns/viewer_frames.py HOST PORT SECONDS
"""

import base64
import os
import pathlib
import socket
import struct
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
from wire import viewer_pb2  # noqa: E402

BINARY, CLOSE, PING, PONG = 2, 8, 9, 10


class WebSocket:
    """RFC 6455, client side, as far as this test needs it."""

    def __init__(self, host, port, path):
        self.socket = socket.create_connection((host, port), timeout=5)
        key = base64.b64encode(os.urandom(16)).decode()
        request = (
            f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: http://{host}:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        self.socket.sendall(request.encode())
        self.pending = b""
        while b"\r\n\r\n" not in self.pending:
            self.pending += self.received()
        head, self.pending = self.pending.split(b"\r\n\r\n", 1)
        if b" 101 " not in head.split(b"\r\n")[0]:
            raise AssertionError(f"no WebSocket at {path}: {head!r}")

    def received(self):
        data = self.socket.recv(1 << 16)
        if not data:
            raise AssertionError("the viewer closed the connection")
        return data

    def take(self, count):
        while len(self.pending) < count:
            self.pending += self.received()
        taken, self.pending = self.pending[:count], self.pending[count:]
        return taken

    def message(self):
        """Payload of the next data message."""
        whole = b""
        while True:
            first, second = self.take(2)
            length = second & 0x7F
            if length == 126:
                (length,) = struct.unpack(">H", self.take(2))
            elif length == 127:
                (length,) = struct.unpack(">Q", self.take(8))
            payload, code = self.take(length), first & 0x0F
            if code == CLOSE:
                raise AssertionError(f"the viewer closed: {payload!r}")
            if code == PING:
                self.send(payload, PONG)
            elif code != PONG:
                whole += payload
                if first & 0x80:
                    return whole

    def send(self, payload, code=BINARY):
        mask = os.urandom(4)
        size = bytes([0x80 | len(payload)]) if len(payload) < 126 else b"\xfe" + struct.pack(">H", len(payload))
        masked = bytes(b ^ mask[i % 4] for i, b in enumerate(payload))
        self.socket.sendall(bytes([0x80 | code]) + size + mask + masked)


def main(host, port, seconds):
    page = WebSocket(host, int(port), "/ws")
    end, epochs, frames = time.monotonic() + float(seconds) + 5, {}, 0
    started = None
    while time.monotonic() < end and (started is None or time.monotonic() < started + float(seconds)):
        down = viewer_pb2.ViewerDown.FromString(page.message())
        kind = down.WhichOneof("message")
        if kind == "topology":
            epochs[down.topology.body_id] = (down.topology.epoch, down.topology.vertex_count)
        elif kind in ("frame", "coarse_frame"):
            frame = down.frame if kind == "frame" else down.coarse_frame.frame
            expected = (frame.epoch, frame.vertex_count)
            if epochs.get(frame.body_id) != expected:
                raise AssertionError(f"a frame of {expected} without its topology: {epochs}")
            frames, started = frames + 1, started or time.monotonic()
            ack = viewer_pb2.ViewerUp()
            ack.frame_ack.frames = frames
            page.send(ack.SerializeToString())
    rate = frames / float(seconds)
    print(f"page: {frames} frames, {rate:.0f} per second, bodies {epochs}")
    if rate < 10:
        raise AssertionError("fewer than 10 frames per second")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except (AssertionError, OSError) as error:
        sys.exit(f"viewer_frames.py: {error!r}")

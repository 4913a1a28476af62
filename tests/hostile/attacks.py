"""What hostile clients do, one kind per process, several clients in each.

    python tests/hostile/attacks.py KIND CLIENTS SECONDS PORT PAGE_PORT

Prints how much it did. The process runs only when nothing else wants the processor (SCHED_IDLE): hostile clients
have machines of their own, and would otherwise take the server's time by their own work.
"""

import contextlib
import os
import pathlib
import random
import signal
import socket
import struct
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))

import zenoh  # noqa: E402
from client import Session, encoding, exit_now  # noqa: E402
from wire import cut_pb2, server_pb2, tool_pb2  # noqa: E402

# Bytes that a web socket's server answers with before the first message.
GREETING = 64


def join(port):
    return Session(f"tcp/127.0.0.1:{port}", "scindo", "main")


def raw(port):
    return socket.create_connection(("127.0.0.1", port), timeout=5)


def pause(seconds):
    time.sleep(seconds)


# --- against the port of zenoh ---


def flood(k, port, _):
    """Poses and cuts as fast as they go: valid, of tools it does not hold, in another's name, and noise."""
    session, rng = join(port), random.Random(k)
    name, count = f"flood-{k}", 0
    while True:
        count += 1
        who = name if count % 3 else "honest"
        sample = tool_pb2.ToolSample(client_id=who, tool_id=f"t{count % 40}", seq=count)
        sample.pose.qw = rng.choice([1.0, 0.0, float("nan"), 1e300])
        sample.pose.position_m.x = rng.choice([0.05, float("inf"), -1e30])
        payload = rng.randbytes(rng.randrange(200)) if count % 4 == 0 else None
        session.put(f"client/{name}/tool/t{count % 40}/pose", sample, payload)
        cut = cut_pb2.CutCommand(client_id=who, tool_id="scalpel", body_id="block", seq=count)
        session.put(f"client/{name}/tool/scalpel/cut", cut, payload)
        yield 2


def giant(k, port, _):
    """Messages of a megabyte and more."""
    session = join(port)
    while True:
        session.put(f"client/giant-{k}/tool/scalpel/cut", cut_pb2.CutCommand(), b"\xff" * (1 << 20))
        session.put(f"client/giant-{k}/tool/scalpel/pose", tool_pb2.ToolSample(), b"\x00" * (3 << 20))
        yield 2


def half(k, port, _):
    """Opens a link, promises a message of 60 kB, sends half of it and waits."""
    rng = random.Random(k)
    while True:
        with contextlib.suppress(OSError), raw(port) as link:
            link.sendall(struct.pack("<H", 60000) + rng.randbytes(30000))
            pause(0.5)
        yield 1


def tokens(k, port, _):
    """Declares and takes back presence under ever new names."""
    session, count = join(port), 0
    while True:
        kept = []
        for _ in range(32):
            count += 1
            key = session.key(f"client/token-{k}-{count}/live/client")
            kept.append(session.zenoh.liveliness().declare_token(key))
        yield len(kept)
        pause(0.05)
        for token in kept:
            token.undeclare()


def queries(k, port, _):
    """Orders that are refused, questions that are answered, and noise."""
    session, rng = join(port), random.Random(k)
    while True:
        for verb, message in [("set", server_pb2.SetRequest(key="world.gravity_m_s2", value="nan")), ("info", None)]:
            payload = message.SerializeToString() if message and rng.random() < 0.5 else rng.randbytes(100)
            kind = encoding(message) if message else "text/plain"
            replies = session.zenoh.get(
                session.key(f"rpc/{verb}"), payload=payload, encoding=zenoh.Encoding(kind), timeout=2.0
            )
            for _ in replies:
                pass
            yield 1


def slow(k, port, _):
    """Subscribes to everything. Its process is stopped, so it reads nothing."""
    session = join(port)
    kept = session.zenoh.declare_subscriber(session.key("**"), lambda _: None)
    yield 1
    while kept:
        pause(1.0)
        yield 0


def storm(_k, port, _):
    """Connects and goes, raw and as a client of zenoh."""
    count = 0
    while True:
        count += 1
        if count % 8 == 0:
            with contextlib.suppress(zenoh.ZError, AssertionError):
                join(port).zenoh.close()
        else:
            with contextlib.suppress(OSError):
                raw(port).close()
        yield 1
        pause(0.01)


def handshakes(k, port, _):
    """Says something else than zenoh does."""
    rng = random.Random(k)
    while True:
        with contextlib.suppress(OSError), raw(port) as link:
            words = [rng.randbytes(rng.randrange(1, 4000)), b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00" * 50]
            link.sendall(rng.choice(words))
            link.settimeout(0.2)
            link.recv(100)
        yield 1
        pause(0.01)


# --- against the port of the page ---


def web_socket(page):
    link = raw(page)
    link.sendall(
        f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{page}\r\nOrigin: http://127.0.0.1:{page}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    link.recv(GREETING)
    return link


def framed(payload, opcode=2, length=None):
    """A web socket's frame with the mask 0."""
    length = len(payload) if length is None else length
    if length < 126:
        size = bytes([0x80 | length])
    else:
        size = b"\xfe" + struct.pack(">H", length) if length < 1 << 16 else b"\xff" + struct.pack(">Q", length)
    return bytes([0x80 | opcode]) + size + b"\0\0\0\0" + payload


def page_flood(k, _, page):
    """Requests of the page's files, as fast as they go."""
    paths = ["/", "/healthz", "/viewer.js", "/../../etc/passwd", "/%00", "/ws", "/" + "a" * 2000]
    rng = random.Random(k)
    while True:
        with contextlib.suppress(OSError), raw(page) as link:
            link.sendall(f"GET {rng.choice(paths)} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n".encode())
            while link.recv(1 << 16):
                pass
        yield 1


def page_giant(k, _, page):
    """Messages far beyond the limit, and headers without end."""
    while True:
        with contextlib.suppress(OSError), web_socket(page) as link:
            link.settimeout(0.5)
            link.sendall(framed(b"\xff" * (1 << 20)))
            link.sendall(framed(b"", length=1 << 40))
        with contextlib.suppress(OSError), raw(page) as link:
            link.settimeout(0.5)
            link.sendall(b"GET / HTTP/1.1\r\n")
            for _ in range(2000):
                link.sendall(b"X-Long: " + b"y" * 1000 + b"\r\n")
        yield 2


def page_half(k, _, page):
    """Half a request, half a frame, one byte at a time."""
    while True:
        with contextlib.suppress(OSError), web_socket(page) as link, raw(page) as other:
            link.sendall(framed(b"abc", length=60000))
            for letter in b"GET / HT":
                other.sendall(bytes([letter]))
                pause(0.1)
        yield 2


def page_noise(k, _, page):
    """A browser whose messages are noise."""
    rng = random.Random(k)
    while True:
        with contextlib.suppress(OSError), web_socket(page) as link:
            for _ in range(200):
                link.sendall(framed(rng.randbytes(rng.randrange(1, 125)), opcode=rng.choice([1, 2, 2, 2, 9])))
                yield 1
        yield 1


def page_slow(k, _, page):
    """Takes a seat and reads nothing."""
    while True:
        with contextlib.suppress(OSError), web_socket(page) as link:
            yield 1
            for _ in range(20):
                pause(0.5)
                link.sendall(framed(b"", opcode=9))
                yield 0
        pause(0.05)
        yield 0


def page_storm(_k, _, page):
    """Connects and goes."""
    while True:
        with contextlib.suppress(OSError):
            raw(page).close()
        yield 1
        pause(0.005)


def page_handshakes(k, _, page):
    """Noise where a request is expected, and wrong requests for a web socket."""
    rng = random.Random(k)
    while True:
        with contextlib.suppress(OSError), raw(page) as link:
            wrong = b"GET /ws HTTP/1.1\r\nHost: x\r\nOrigin: http://evil.example\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\r\n"
            link.sendall(rng.choice([rng.randbytes(2000), wrong, b"\x16\x03\x01" * 100]))
            link.settimeout(0.2)
            link.recv(100)
        yield 1
        pause(0.01)


def page_seats(_k, _, page):
    """Takes seats and gives them back."""
    while True:
        with contextlib.suppress(OSError):
            web_socket(page).close()
        yield 1
        pause(0.01)


NETWORK = [flood, giant, half, tokens, queries, slow, storm, handshakes]
PAGE = [page_flood, page_giant, page_half, page_noise, page_slow, page_storm, page_handshakes, page_seats]


def keep_on(attack, k, port, page, end, done):
    """An attacker who is thrown out comes back."""
    while time.monotonic() < end:
        with contextlib.suppress(OSError, zenoh.ZError, AssertionError):
            for count in attack(k, port, page):
                done[k] += count
                if time.monotonic() >= end:
                    return
        pause(0.1)


def main():
    kind, clients, seconds, port, page = sys.argv[1], *map(int, sys.argv[2:6])
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    attack = next(a for a in NETWORK + PAGE if a.__name__ == kind)
    done, end = [0] * clients, time.monotonic() + seconds
    threads = [
        threading.Thread(target=keep_on, args=(attack, k, port, page, end, done), daemon=True) for k in range(clients)
    ]
    for thread in threads:
        thread.start()
    if attack is slow:
        while sum(done) < clients and time.monotonic() < end:
            pause(0.1)
        print(sum(done), flush=True)
        os.kill(os.getpid(), signal.SIGSTOP)
    for thread in threads:
        thread.join(timeout=max(0.0, end + 5 - time.monotonic()))
    print(sum(done), flush=True)
    exit_now(0)


if __name__ == "__main__":
    main()

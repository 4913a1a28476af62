"""scindo-igtl between a running server and pyigtl, an OpenIGTLink implementation that others use.

    python tests/igtl/igtl.py BIN_DIR OUT_DIR
"""

import pathlib
import socket
import struct
import sys
import time

import numpy as np
import pyigtl

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "python"), str(HERE.parent / "haptic")]
from client import Session, check, exit_now  # noqa: E402
from haptic import Programs, free_endpoint  # noqa: E402
from messages import Bare, Tracking  # noqa: E402
from wire import server_pb2, surface_pb2, tool_pb2  # noqa: E402

# Only a program that hangs makes anything take this long [s].
PATIENCE = 40.0


def until(condition, what, patience=PATIENCE):
    """The first true value of `condition`."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        value = condition()
        if value is not None and value is not False:
            return value
        time.sleep(0.02)
    raise AssertionError(f"within {patience:g} s: {what}")


def matrix(x, y, z):
    """A tool at x, y, z [mm] whose shaft points up."""
    at = np.eye(4)
    at[:3, 3] = (x, y, z)
    return at


class Peer:
    """pyigtl, and the newest message of each device that was of interest."""

    def __init__(self, end):
        self.end = end

    def send(self, message):
        check(self.end.send_message(message, wait=False), "pyigtl takes the message")

    def move(self, device, *at_mm, version=1):
        message = pyigtl.TransformMessage(matrix(*at_mm), device_name=device)
        message.header_version = version
        if version > 1:
            message.metadata = {"Unit": "mm"}
        self.send(message)

    def say(self, device, text):
        self.send(pyigtl.StringMessage(text, device_name=device))

    def get(self, device, condition=lambda message: True, what="", again=lambda: None):
        """The next message of a device that meets the condition; `again` is done meanwhile."""

        def next_one():
            again()
            message = self.end.wait_for_message(device, timeout=0.05)
            return message if message is not None and condition(message) else None

        return until(next_one, f"{device}: {what}")

    def force(self, condition, what, again=lambda: None):
        read = lambda message: np.array([float(word) for word in message.string.split()])  # noqa: E731
        return read(self.get("force-probe", lambda message: condition(read(message)), what, again))


class Tools:
    """Newest states of the server's tools."""

    def __init__(self, session):
        self.subscriber, self.states = session.subscribe("tool/*/state", tool_pb2.ToolState)
        self.newest = {}

    def get(self, tool):
        while not self.states.empty():
            state = self.states.get()
            self.newest[state.tool_id] = state
        return self.newest.get(tool)


def port():
    return int(free_endpoint().rsplit(":", 1)[1])


def bridge(programs, endpoint, log, *more):
    process = programs.start("scindo-igtl", "--connect", endpoint, "--tool", "Stylus=probe", "--tool", "Knife=knife",
                             "--surface-hz", 60, *more, log=log)
    until(lambda: "OpenIGTLink at" in text(programs, log) or "connecting to" in text(programs, log), "the bridge runs")
    check(process.poll() is None, f"the bridge runs; see {log}")
    return process


def text(programs, log):
    return (programs.out / log).read_text()


def surfaces(peer, session):
    """POLYDATA is the surface that the server has."""
    poly = peer.get("block", what="a surface")
    frame = session.ask("body/block/surface/keyframe", surface_pb2.SurfaceKeyframe)
    triangles = np.frombuffer(frame.topology.triangles, "<u4").reshape(-1, 3)
    check(np.array_equal(poly.polygons, triangles), f"the same {len(triangles)} triangles")
    mine = 1e3 * np.frombuffer(frame.frame.positions, "<f4").reshape(-1, 3)
    apart = np.abs(poly.points - mine).max()
    check(apart < 5.0, f"the same points in millimetres, {apart:.3f} mm apart")
    lengths = np.linalg.norm(poly.normals, axis=1)
    outwards = np.einsum("ij,ij->i", poly.normals, poly.points - poly.points.mean(axis=0))
    check(np.allclose(lengths, 1, atol=1e-4) and (outwards > 0).all(), "normals have length one and point outwards")
    check(abs(time.time() - poly.timestamp) < 60, "the time is that of the clock")
    return poly


def touch(peer, tools):
    """A tracked stylus presses the block; a word lifts it."""
    press = lambda: peer.move("Stylus", 60, 30, 42)  # noqa: E731
    rest = lambda: peer.move("Stylus", 60, 30, 80)  # noqa: E731
    peer.get("scindo-probe", lambda m: np.allclose(m.matrix[:3, 3], (60, 30, 80), atol=1e-3), "hovers above", rest)
    check(tools.get("probe").owner.startswith("igtl-"), "the bridge holds the tool")
    event = peer.get("scindo-event", lambda m: "probe" in m.string, "an event that tells who holds the tool", rest)
    print(f"event: {event.string}")
    pushed = peer.force(lambda f: f[2] > 0.05, "the tissue pushes up", press)
    print(f"force on the probe: {pushed} N")
    peer.say("Stylus", "hover")
    peer.force(lambda f: not f.any(), "hovering, no force", press)
    peer.say("Stylus", "touch")
    peer.force(lambda f: f[2] > 0.05, "touching again", lambda: peer.move("Stylus", 60, 30, 42, version=2))
    # The tracker has lost the stylus: it touches nothing.
    peer.force(lambda f: not f.any(), "no transform, no force")
    check(tools.get("probe").mode == tool_pb2.ToolSample.MODE_HOVER, "a silent device hovers")
    peer.send(Tracking({"Stylus": matrix(60, 30, 90), "Knife": matrix(10, 30, 90)}))
    until(lambda: tools.get("knife"), "TDATA moves a tool that the scene does not know")
    at = until(lambda: (s := tools.get("probe")) and abs(s.pose.position_m.z - 0.09) < 1e-6 and s, "TDATA in metres")
    check(at.pose.qw == 1.0 and abs(at.pose.position_m.x - 0.06) < 1e-6, "upright, at x = 60 mm")


def questions(peer):
    peer.send(Bare("GET_STATUS"))
    status = peer.get("scindo", lambda m: m._message_type == "STATUS", "a status")
    check(status.code == 1 and "block" in status.text, f"fine: {status.text}")
    peer.send(Bare("GET_CAPABIL"))
    kinds = peer.get("scindo", lambda m: m._message_type == "CAPABILITY", "its types").content
    check(b"POLYDATA" in kinds and len(kinds) % 12 == 0, "types of 12 bytes each")
    peer.send(Bare("STT_TDATA", struct.pack(">I32s", 20, b"RAS")))
    tracked = peer.get("scindo", lambda m: m._message_type == "TDATA" and len(m.tools) == 2, "a stream of tools")
    check(np.allclose(tracked.tools["scindo-probe"][:3, 3], (60, 30, 90), atol=0.5), "all tools in one message")
    peer.send(Bare("STP_TDATA"))
    peer.send(Bare("STP_POLYDATA"))
    peer.get("", lambda m: m._message_type == "RTS_POLYDATA" and m.content == b"\0", "no more surfaces")
    peer.get("block")
    time.sleep(0.3)
    check(peer.end.wait_for_message("block", timeout=0.5) is None, "surfaces stop when asked")
    peer.send(Bare("GET_POLYDATA", device_name="block"))
    peer.get("block", what="one surface when asked")
    peer.send(Bare("STT_POLYDATA", device_name="block"))
    peer.get("block", what="surfaces again")


def liars(programs, address, log, peer):
    """Peers that send what is no OpenIGTLink are closed with a reason; the honest one goes on."""
    good = pyigtl.StringMessage("hover", device_name="Stylus").pack()
    spoilt = good[:-1] + bytes([good[-1] ^ 1])
    giant = good[:42] + struct.pack(">Q", 1 << 40) + good[50:]
    for sent, reason in [(b"GET / HTTP/1.1\r\n\r\n" * 8, "does not speak OpenIGTLink"), (giant, "at most 1048576"),
                         (spoilt * 8, "wrong check sum")]:
        with socket.create_connection(address) as liar:
            liar.settimeout(PATIENCE)
            liar.sendall(sent)
            try:
                while liar.recv(65536):
                    pass
            except ConnectionError:
                pass
        until(lambda reason=reason: reason in text(programs, log), f"closed: {reason}")
        time.sleep(1.2)  # the log has one line per second and place
    peer.get("block", what="surfaces beside liars")


def flood(address, session, tools):
    """A peer that sends as fast as it can: the server gets the chosen rate of poses and steps on."""
    subscriber, stats = session.subscribe("stats", server_pb2.Stats)
    end, sent = time.monotonic() + 4.0, 0
    with socket.create_connection(address) as hose:
        hose.setblocking(False)
        message = pyigtl.TransformMessage(matrix(10, 10, 90), device_name="Knife").pack() * 200
        while time.monotonic() < end:
            try:
                sent += hose.send(message[sent % len(message) :])
            except BlockingIOError:
                time.sleep(0.001)
            try:
                while hose.recv(65536):
                    pass
            except BlockingIOError:
                pass
        told = [stats.get() for _ in range(stats.qsize())]
        newest = told[-1]
        rate = next(tool.pose_rate_hz for tool in newest.tools if tool.tool_id == "knife")
        check(tools.get("knife").owner, "the flood moves its tool")
    check(sent > 10_000 * 106, f"{sent / 106:.0f} transforms went out")
    check(0 < rate < 300, f"at most 250 poses per second arrive: {rate:.0f}")
    steps = newest.sim_step - told[0].sim_step
    check(steps > 20, f"the server goes on: {steps} steps, real time x {newest.real_time_factor:.2f}")
    print(f"flood: {sent / 106 / 4:.0f} transforms per second became {rate:.0f} poses per second")
    subscriber.undeclare()


def deaf(programs, address, log, peer, session):
    """A peer that reads nothing is closed; server and honest peer do not wait for it."""
    subscriber, stats = session.subscribe("stats", server_pb2.Stats)
    ear = socket.socket()
    ear.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    ear.connect(address)
    started, seen = time.monotonic(), 0
    while "has read nothing for 5s" not in text(programs, log):
        check(time.monotonic() - started < 120, "the deaf peer is closed within two minutes")
        peer.get("block", what="surfaces beside a deaf peer")
        seen += 1
    told = [stats.get() for _ in range(stats.qsize())]
    steps = told[-1].sim_step - told[0].sim_step
    check(seen > 10 and steps > 20, f"the server goes on: {steps} steps, real time x {told[-1].real_time_factor:.2f}")
    print(f"deaf peer closed after {time.monotonic() - started:.1f} s, {seen} surfaces went to the other")
    ear.close()
    subscriber.undeclare()


def main():
    programs = Programs(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
    endpoint, number = free_endpoint(), port()
    address = ("127.0.0.1", number)
    try:
        server = programs.server(endpoint)
        session = Session(endpoint, "scindo", "main")
        tools = Tools(session)
        bridge(programs, endpoint, "listening.log", "--listen", f"127.0.0.1:{number}")
        peer = Peer(pyigtl.OpenIGTLinkClient(*address))
        poly = surfaces(peer, session)
        print(f"surface of {len(poly.points)} points and {len(poly.polygons)} triangles")
        touch(peer, tools)
        questions(peer)
        liars(programs, address, "listening.log", peer)
        peer.end.stop()
        until(lambda: not tools.get("probe").owner, "a peer that goes lets go of its tools")
        print("the tools of a peer that went are free")
        flood(address, session, tools)
        peer = Peer(pyigtl.OpenIGTLinkClient(*address))
        deaf(programs, address, "listening.log", peer, session)
        peer.end.stop()

        # pyigtl as the server, which 3D Slicer is as well. It goes and comes back.
        other = port()
        for attempt in ("first", "second"):
            slicer = pyigtl.OpenIGTLinkServer(port=other, local_server=True)
            if attempt == "first":
                bridge(programs, endpoint, "connecting.log", "--peer", f"127.0.0.1:{other}", "--axes", "lps")
            peer = Peer(slicer)
            surface = peer.get("block", what=f"a surface over the {attempt} connection")
            check(surface.points[:, 0].max() < 1 and surface.points[:, 0].min() < -100, "LPS: x points to the left")
            above = lambda peer=peer: peer.move("Stylus", -60, -30, 80)  # noqa: E731
            at = (-60, -30, 80)
            peer.get("scindo-probe", lambda m: np.allclose(m.matrix[:3, 3], at, atol=1e-3), "moved", above)
            check(abs(tools.get("probe").pose.position_m.x - 0.06) < 1e-6, "LPS: -60 mm are +0.06 m")
            if attempt == "first":
                slicer.stop()
                slicer.server_close()
        print("the bridge connects to a server again after that was away")

        server.kill()
        server.wait()
        gone = peer.get("scindo", lambda m: m._message_type == "STATUS" and m.code == 13, "a status without server")
        print(f"status: {gone.text}")
        programs.server(endpoint, log="server-2.log")
        peer.get("scindo", lambda m: m._message_type == "STATUS" and m.code == 1, "a status with the server")
        peer.get("block", what="surfaces of the new server")
        for log in ("listening.log", "connecting.log"):
            check("panicked" not in text(programs, log), f"no panic in {log}")
        print("passed")
    finally:
        programs.end()


if __name__ == "__main__":
    main()
    exit_now(0)

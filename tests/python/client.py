"""A client with nothing but public packages: eclipse-zenoh, protobuf and numpy.

Joins a running server, mirrors a body, sends one cut twice and sees it applied once, sends what
must be refused and sees it counted while the server goes on.

    python tests/python/client.py --connect tcp/127.0.0.1:7447 [--body ID] [--tool ID]
"""

import argparse
import queue
import sys
import threading
import time

import numpy as np
import zenoh

from wire import cut_pb2, force_pb2, server_pb2, surface_pb2, tool_pb2

CLIENT = "python-test"
# Only a server that hangs makes anything take this long, however busy the machine is [s].
PATIENCE = 60.0


class Session:
    """One zenoh session in client mode and the key space of one scindo session."""

    def __init__(self, endpoint, realm, session):
        config = zenoh.Config()
        for key, value in [
            ("mode", '"client"'),
            ("connect/endpoints", f'["{endpoint}"]'),
            ("connect/timeout_ms", "60000"),
            ("scouting/multicast/enabled", "false"),
            ("scouting/gossip/enabled", "false"),
        ]:
            config.insert_json5(key, value)
        self.zenoh = zenoh.open(config)
        self.prefix = f"{realm}/@v1/{session}/"

    def key(self, topic):
        return self.prefix + topic

    def ask(self, topic, reply_type):
        """One query, one decoded answer; asked again while a busy server has none."""
        end, replies = time.monotonic() + PATIENCE, []
        while not replies and time.monotonic() < end:
            replies = list(self.zenoh.get(self.key(topic), timeout=2.0))
        check(replies, f"{topic} was answered")
        if replies[0].ok is None:
            raise AssertionError(f"{topic}: {replies[0].err.payload.to_bytes()!r}")
        return decode(replies[0].ok, reply_type)

    def subscribe(self, topic, message_type):
        """A queue of decoded messages, oldest dropped beyond 512."""
        received = queue.Queue(512)

        def on_sample(sample):
            if received.full():
                received.get_nowait()
            received.put(decode(sample, message_type))

        return self.zenoh.declare_subscriber(self.key(topic), on_sample), received

    def forces(self):
        """The forces of contact, newest last: `session.forces()[1].get().pairs`."""
        return self.subscribe("forces", force_pb2.Forces)

    def put(self, topic, message, payload=None):
        self.zenoh.put(
            self.key(topic),
            message.SerializeToString() if payload is None else payload,
            encoding=zenoh.Encoding(encoding(message)),
            congestion_control=zenoh.CongestionControl.BLOCK,
        )


def encoding(message):
    return f"application/protobuf;{message.DESCRIPTOR.full_name}"


def decode(sample, message_type):
    stated, expected = str(sample.encoding), encoding(message_type())
    check(stated == expected, f"encoding {stated} is {expected}")
    return message_type.FromString(sample.payload.to_bytes())


def check(condition, claim):
    if not condition:
        raise AssertionError(f"not so: {claim}")


def positions(frame):
    """Vertices of a frame as an n × 3 array [m], checked."""
    points = np.frombuffer(frame.positions, dtype="<f4")
    check(points.size == 3 * frame.vertex_count, "three numbers per vertex")
    check(np.isfinite(points).all(), "positions are finite")
    return points.reshape(-1, 3)


def surface(session, body):
    """The keyframe as points, triangles and tags of one epoch."""
    key = session.ask(f"body/{body}/surface/keyframe", surface_pb2.SurfaceKeyframe)
    topology, points = key.topology, positions(key.frame)
    triangles = np.frombuffer(topology.triangles, dtype="<u4").reshape(-1, 3)
    tags = np.frombuffer(topology.tags, dtype="<u4")
    check(topology.epoch == key.frame.epoch, "topology and frame are of one epoch")
    check(topology.vertex_count == len(points), "one vertex count in topology and frame")
    check(len(triangles) == topology.triangle_count == len(tags), "one tag per triangle")
    check(triangles.max() < len(points), "triangles name existing vertices")
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    check((uses % 2 == 0).all(), "the surface is closed")
    return topology.epoch, points, triangles, tags


def watch_frames(session, body, epoch, vertices, count):
    """So many frames: order, epoch, size, finiteness, five or more per simulated second. Returns the last and the
    rate."""
    subscription, frames = session.subscribe(f"body/{body}/surface/frame", surface_pb2.SurfaceFrame)
    start, first, last = time.monotonic(), None, None
    for seen in range(count):
        try:
            frame = frames.get(timeout=PATIENCE)
        except queue.Empty:
            raise AssertionError(f"no frame for {PATIENCE:.0f} s, {seen} before") from None
        if frame.epoch == epoch:
            check(len(positions(frame)) == vertices, "a frame has the vertices of its epoch")
        if last is not None:
            check(frame.seq > last.seq and frame.sim_time_s >= last.sim_time_s, "frames are in order")
        first, last = first or frame, frame
    subscription.undeclare()
    simulated = last.sim_time_s - first.sim_time_s
    check(count >= 5 * simulated, f"{count} frames in {simulated:.2f} simulated seconds are at least 5 per second")
    return last, count / (time.monotonic() - start)


def crossing_cut(points, tool, body, seq):
    """A blade that sweeps right through the middle of the body, across its longest axis."""
    low, high = points.min(axis=0).astype(float), points.max(axis=0).astype(float)
    across, along, up = np.argsort(high - low)[::-1]
    margin = 0.1 * (high - low).max()
    command = cut_pb2.CutCommand(
        client_id=CLIENT, tool_id=tool, body_id=body, seq=seq, client_time_ns=time.time_ns()
    )
    for part in np.linspace(0.0, 1.0, 13):
        tip = np.empty(3)
        # Off the middle, so that the blade meets no symmetric plane of nodes.
        tip[across] = low[across] + 0.513 * (high - low)[across]
        tip[along] = low[along] - margin + part * (high[along] - low[along] + 2 * margin)
        tip[up] = low[up] - margin
        heel = tip.copy()
        heel[up] = high[up] + margin
        segment = command.sweep.add()
        segment.tip_m.x, segment.tip_m.y, segment.tip_m.z = tip
        segment.heel_m.x, segment.heel_m.y, segment.heel_m.z = heel
    return command


def acknowledgement(session, acks, tool, command):
    """The acknowledgement of a cut, which is sent again until it comes: the server applies it once."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        session.put(f"client/{CLIENT}/tool/{tool}/cut", command)
        try:
            while True:
                ack = acks.get(timeout=0.5)
                if ack.client_id == CLIENT and ack.seq == command.seq:
                    return ack
        except queue.Empty:
            continue
    raise AssertionError(f"cut {command.seq} was not acknowledged within {PATIENCE:.0f} s")


def cut_twice(session, body, tool):
    """The same command twice: applied once, then recognised."""
    epoch, points, _, tags = surface(session, body)
    watched, stats = session.subscribe("stats", server_pb2.Stats)
    applied = next_stats(stats).cuts_applied
    subscription, acks = session.subscribe(f"tool/{tool}/cut_ack", cut_pb2.CutAck)
    command = crossing_cut(points, tool, body, seq=1)
    first = acknowledgement(session, acks, tool, command)
    # The very first answer may have come before the subscription had reached the server.
    outcomes = (cut_pb2.CutAck.OUTCOME_APPLIED, cut_pb2.CutAck.OUTCOME_DUPLICATE)
    check(first.outcome in outcomes, f"applied: {first}")
    check(first.elements_cut > 0, "elements were cut")
    second = acknowledgement(session, acks, tool, command)
    check(second.outcome == cut_pb2.CutAck.OUTCOME_DUPLICATE, f"recognised: {second}")
    subscription.undeclare()
    epochs = {e.body_id: e.epoch for e in first.epochs}
    check(epochs.get(body) == epoch + 1, f"epoch {epoch} rose by one to {epochs.get(body)}")
    applied = next_stats(stats, first.sim_step + 10).cuts_applied - applied
    check(applied == 1, f"one cut was applied, found {applied}")
    watched.undeclare()
    after, points_after, _, tags_after = surface(session, body)
    check(after == epoch + 1, f"still epoch {epoch + 1}: found {after}")
    check(len(points_after) > len(points), "the cut has new vertices")
    lips = set(tags_after.tolist()) - set(tags.tolist())
    check(len(lips) == 1, f"one new incision: tags {lips}")
    return first.elements_cut, after, len(points_after)


def feel(session, body, tool):
    """Lowers a tool into the middle of the top until the server reports the force, and adds its points up."""
    _, points, _, _ = surface(session, body)
    low, high = points.min(axis=0).astype(float), points.max(axis=0).astype(float)
    subscription, forces = session.forces()
    sample = tool_pb2.ToolSample(client_id=CLIENT, tool_id=tool, mode=tool_pb2.ToolSample.MODE_TOUCH)
    sample.pose.qw = 1.0
    end, height, pair = time.monotonic() + PATIENCE, high[2] + 0.02, None
    while pair is None and time.monotonic() < end:
        height = max(height - 5e-4, high[2] - 0.002)
        sample.seq += 1
        sample.client_time_ns = time.time_ns()
        at = (0.25 * low[0] + 0.75 * high[0], 0.5 * (low[1] + high[1]), height)
        sample.pose.position_m.x, sample.pose.position_m.y, sample.pose.position_m.z = at
        session.put(f"client/{CLIENT}/tool/{tool}/pose", sample)
        pairs = forces.get(timeout=PATIENCE).pairs
        pair = next((p for p in pairs if (p.on, p.by) == (body, tool) and p.normal_n > 0.01), None)
    subscription.undeclare()
    check(pair is not None, f"{tool} presses on {body} within {PATIENCE:.0f} s")
    check(pair.kind == force_pb2.ForcePair.KIND_TOOL and pair.force_n.z < 0.0, f"it pushes downwards: {pair}")
    vector = lambda v: np.array([v.x, v.y, v.z])
    total = sum(p.normal_n * vector(p.normal) + vector(p.tangential_n) for p in pair.points)
    if len(pair.points) == pair.contacts:
        size = np.linalg.norm(vector(pair.force_n))
        check(np.linalg.norm(total - vector(pair.force_n)) < 1e-4 * size, f"the points add up: {total} {pair.force_n}")
    return np.linalg.norm(vector(pair.force_n))


def refused(stats):
    return {counter.name: counter.count for counter in stats.refused}


def next_stats(stats, after_step=0):
    end = time.monotonic() + PATIENCE
    while (left := end - time.monotonic()) > 0:
        try:
            message = stats.get(timeout=left)
        except queue.Empty:
            break
        if message.sim_step > after_step:
            return message
    raise AssertionError(f"no statistics beyond step {after_step} within {PATIENCE:.0f} s")


def bad_input(session, body, tool):
    """A pose that is not finite, a cut with too many segments, bytes that are no message: all are
    refused and counted, and the server goes on."""
    subscription, stats = session.subscribe("stats", server_pb2.Stats)
    before = next_stats(stats)
    pose = tool_pb2.ToolSample(seq=1, client_time_ns=1, client_id=CLIENT, tool_id=tool)
    pose.pose.position_m.x = float("nan")
    pose.pose.qw = 1.0
    pose.velocity_m_s.SetInParent()
    cut = cut_pb2.CutCommand(client_id=CLIENT, tool_id=tool, seq=2, body_id=body)
    for _ in range(1500):
        segment = cut.sweep.add()
        segment.tip_m.SetInParent()
        segment.heel_m.SetInParent()
    session.put(f"client/{CLIENT}/tool/{tool}/pose", pose)
    session.put(f"client/{CLIENT}/tool/{tool}/cut", cut)
    session.put(f"client/{CLIENT}/tool/{tool}/cut", cut, payload=b"\xff" * 200_000)
    session.put(f"client/{CLIENT}/tool/{tool}/pose", pose, payload=b"\x08")
    end = time.monotonic() + PATIENCE
    while True:
        now = next_stats(stats, before.sim_step)
        new = {k: v - refused(before).get(k, 0) for k, v in refused(now).items()}
        if sum(new.values()) >= 4:
            break
        check(time.monotonic() < end, f"four refusals are counted, found {new}")
    check(now.cuts_applied == before.cuts_applied, "no cut was applied")
    later = next_stats(stats, now.sim_step)
    subscription.undeclare()
    check(later.sim_step > now.sim_step, "the simulation goes on")
    return {k: v for k, v in new.items() if v}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447")
    parser.add_argument("--realm", default="scindo")
    parser.add_argument("--session", default="main")
    parser.add_argument("--body", help="the first body by default")
    parser.add_argument("--tool", help="the first tool that no script moves by default")
    args = parser.parse_args()
    # zenoh keeps threads; a watchdog ends a run that hangs.
    threading.Timer(600, lambda: (print("client.py: 600 s are over", file=sys.stderr), exit_now())).start()

    session = Session(args.connect, args.realm, args.session)
    token = session.zenoh.liveliness().declare_token(session.key(f"client/{CLIENT}/live/client"))
    info = session.ask("rpc/info", server_pb2.SessionInfo)
    check(info.wire_version == 1, "wire version 1")
    body = args.body or info.bodies[0].id
    tool = args.tool or next((t.id for t in info.tools if t.owner == ""), None)
    check(tool, f"a tool that is free; the scene has {[t.id for t in info.tools]}")
    print(f"server {info.server_version}, scene '{info.scene_name}', body {body}, tool {tool}")

    epoch, points, triangles, _ = surface(session, body)
    print(f"keyframe: epoch {epoch}, {len(points)} vertices, {len(triangles)} triangles")
    last, rate = watch_frames(session, body, epoch, len(points), 40)
    print(f"frames: {rate:.0f} per second, step {last.sim_step}, {last.sim_time_s:.2f} s simulated")
    elements, epoch, vertices = cut_twice(session, body, tool)
    print(f"cut sent twice, applied once: {elements} elements, epoch {epoch}, {vertices} vertices")
    watch_frames(session, body, epoch, vertices, 20)
    print(f"refused and counted: {bad_input(session, body, tool)}")
    watch_frames(session, body, epoch, vertices, 20)
    print("frames go on")
    print(f"{tool} is felt: {feel(session, body, tool):.2f} N")
    token.undeclare()
    session.zenoh.close()
    exit_now(0)


def exit_now(code=1):
    import os

    sys.stdout.flush()
    os._exit(code)


if __name__ == "__main__":
    try:
        main()
    except AssertionError as error:
        print(f"client.py: {error}", file=sys.stderr)
        exit_now(1)

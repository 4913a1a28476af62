"""A session that lasts: a recorded server with hands, cuts, clients that come, go and are killed, and a restart.

    python tests/soak/soak.py BIN_DIR OUT_DIR SECONDS [SEED]

1. Half of the time: a haptic client presses, a surgeon cuts and goes back to the whole body now and then (by a reset, then
   by a snapshot), passers-by join, touch and are killed.
2. The server is killed and goes on from the last checkpoint of its recording. The second half is like the first.
3. Both recordings are computed again on two threads and compared bit for bit. Every cut that was acknowledged is in
   them, except for those of the last second before the kill.

The memory of the server must not grow after a warm-up, in which the surgeon hardly pauses and bodies get more cuts
than any later one: less than 1 MiB per hour by a straight line through all that follows, where the run is long enough to
tell. In such a run the allocator of the server has the settings of deploy/scindo.service, since what it keeps without
them goes up and down by many times more.
"""

import json
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "haptic"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))

import numpy as np  # noqa: E402
from mcap.exceptions import McapError  # noqa: E402
from mcap.records import Channel, Message, Schema  # noqa: E402
from mcap.stream_reader import StreamReader  # noqa: E402
from mcap_protobuf.decoder import DecoderFactory  # noqa: E402

import scindo  # noqa: E402
from client import check, exit_now  # noqa: E402
from haptic import Programs, free_endpoint  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
SIDE = 0.1
# Cuts between two returns to the whole body, which bounds its memory, and pauses between cuts [s].
CUTS_PER_BODY = 12
PAUSES_S = (0.5, 4.0)
# Part of the time for the warm-up, its longest duration [s], pauses in it [s], and how many times as many cuts a body gets.
WARM_UP_PART = 0.15
WARM_UP_S = 240.0
WARM_UP_PAUSES_S = (0.1, 0.3)
WARM_UP_CUTS = 2
# A killed server loses at most this time of its recording [s].
LOST_S = 1.0
# A slope over less time than this says nothing [s].
LONG_S = 1200
SLOPE_KIB_PER_HOUR = 1024
# A server answers within this time of its start [s]; to resume it reads the whole recording.
PATIENCE_S = 300
# Longest record of a recording. A chunk that was being written when the server was killed tells no length.
LONGEST = 1 << 30
# Memory that a short run may need beyond its start, for bodies that are cut [KiB].
ROOM_KIB = 128 * 1024


class Memory:
    """Resident memory of a process, sampled until it ends."""

    def __init__(self, process):
        self.process, self.samples = process, []
        threading.Thread(target=self.run, daemon=True).start()

    def run(self):
        start = time.monotonic()
        while self.process.poll() is None:
            try:
                text = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
            except OSError:
                return
            rss = [line.split()[1] for line in text.splitlines() if line.startswith("VmRSS")]
            if rss:
                self.samples.append((time.monotonic() - start, int(rss[0])))
            time.sleep(1.0)

    def slope(self, after):
        """KiB per hour `after` a time [s], and the time it covers [s]."""
        later = np.array([sample for sample in self.samples if sample[0] >= after], dtype=float)
        if len(later) < 3:
            return 0.0, 0.0
        return np.polyfit(later[:, 0], later[:, 1], 1)[0] * 3600, later[-1, 0] - later[0, 0]


class Surgeon:
    """Cuts at random places, keeps what was acknowledged (when, and which), and goes back to the whole body now and then."""

    def __init__(self, endpoint, seed, warm_up):
        self.endpoint, self.random = endpoint, random.Random(seed)
        self.warm = time.monotonic() + warm_up
        self.acknowledged, self.refused, self.unanswered = [], {}, 0
        self.restored, self.since_whole = 0, 0
        self.stop = threading.Event()
        self.failure = None
        self.thread = threading.Thread(target=self.run, daemon=True)

    def blade(self):
        x, depth = self.random.uniform(0.02, 0.08), self.random.uniform(0.02, 0.06)
        y, reach = self.random.uniform(-0.01, 0.06), self.random.uniform(0.02, 0.07)
        bend = self.random.uniform(-0.02, 0.02)
        path = [(x, y, SIDE - depth), (x + bend, y + reach / 2, SIDE - depth), (x, y + reach, SIDE - depth)]
        if self.random.random() < 0.5:
            path = [(b, a, z) for a, b, z in path]
        return scindo.sweep(path, heel=(0, 0, depth + 0.05))

    def run(self):
        try:
            with scindo.connect(self.endpoint, client="surgeon", timeout=20) as session:
                while not self.stop.wait(self.random.uniform(*(WARM_UP_PAUSES_S if self.warming_up() else PAUSES_S))):
                    self.cut(session)
        except scindo.ScindoError as error:
            self.failure = error

    def warming_up(self):
        return time.monotonic() < self.warm

    def cut(self, session):
        if self.since_whole >= CUTS_PER_BODY * (WARM_UP_CUTS if self.warming_up() else 1):
            # A server that goes on from a recording begins with a body that may be cut.
            if self.restored == 0:
                session.reset()
                session.snapshot("whole")
            else:
                session.restore("whole")
            self.since_whole, self.restored = 0, self.restored + 1
            return
        blade = self.blade()
        # One that is refused counts too: a body may have as many fragments as it is allowed.
        self.since_whole += 1
        try:
            session.cut(blade, timeout=20)
        except scindo.Refused as error:
            self.refused[error.code] = self.refused.get(error.code, 0) + 1
        except scindo.TimedOut:
            self.unanswered += 1
        else:
            self.acknowledged.append((time.monotonic(), blade.tobytes()))

    def end(self):
        self.stop.set()
        self.thread.join(60)
        check(self.failure is None, f"the surgeon works to the end: {self.failure}")
        check(not self.thread.is_alive(), "the surgeon stops")


class Crowd:
    """Passers-by: programs that join, watch and touch, and go without a word after a while."""

    SCRIPT = """
import sys, time
import scindo
session = scindo.connect(sys.argv[1], client=sys.argv[2], timeout=20)
body = session.body("block")
tool = session.tool(sys.argv[2], shape={"sphere": {"radius_m": 0.006}})
angle = 0.0
while True:
    angle += 0.05
    tool.move((0.03 + 0.02 * (angle % 2), 0.05, 0.1 + 0.004), mode="grab" if angle % 3 < 1 else "touch")
    body.positions, session.stats()
    time.sleep(0.02)
"""

    def __init__(self, programs, endpoint, seed):
        self.programs, self.endpoint, self.random = programs, endpoint, random.Random(seed)
        self.killed = 0
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)

    def run(self):
        number = 0
        while not self.stop.is_set():
            number += 1
            name = f"passer-{number}"
            command = [sys.executable, "-c", self.SCRIPT, self.endpoint, name]
            with open(self.programs.out / "passers.log", "ab") as log:
                passer = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
            self.programs.running.append(passer)
            self.stop.wait(self.random.uniform(2.0, 6.0))
            passer.send_signal(self.random.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM]))
            passer.wait()
            self.programs.running.remove(passer)
            self.killed += 1

    def end(self):
        self.stop.set()
        self.thread.join(20)


def settings_of_the_allocator():
    """Those of the service, as `NAME=VALUE`."""
    unit = (HERE.parents[1] / "deploy" / "scindo.service").read_text()
    found = [line for line in unit.splitlines() if line.startswith("Environment=GLIBC_TUNABLES=")]
    check(len(found) == 1, "deploy/scindo.service sets the allocator")
    return found[0].removeprefix("Environment=")


def start(programs, endpoint, recording, *what, before=()):
    log = f"{recording.stem}.log"
    arguments = [*what, "--listen", endpoint, "--record", recording, "--checkpoint-s", 2]
    process = programs.start("scindo", "run", *arguments, log=log, before=before)
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        check(process.poll() is None, f"the server runs; see {programs.out / log}")
        try:
            with scindo.connect(endpoint, client="door", timeout=2):
                return process
        except scindo.ScindoError:
            time.sleep(0.2)
    raise AssertionError(f"the server answers within {PATIENCE_S} s; see {programs.out / log}")


def replay(programs, recording):
    """Computes a recording again and compares it; what was found."""
    command = [programs.bin / "scindo", "replay", recording, "--verify", "--threads", "2", "--json"]
    done = subprocess.run(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    check(done.returncode == 0, f"{recording} is repeated bit for bit: {done.stdout[-2000:]}\n{done.stderr[-2000:]}")
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    return next(line["replayed"] for line in lines if "replayed" in line)


def cuts_of(recording):
    """The blades of all cuts of a recording, which need not have an end."""
    schemas, decoders, blades = {}, {}, []
    try:
        with open(recording, "rb") as stream:
            for record in StreamReader(stream, record_size_limit=LONGEST).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                if isinstance(record, Channel) and record.topic == "record/step":
                    decoders[record.id] = DecoderFactory().decoder_for("protobuf", schemas[record.schema_id])
                if isinstance(record, Message) and record.channel_id in decoders:
                    for cut in decoders[record.channel_id](record.data).cuts:
                        blades.append(np.array([(p.x, p.y, p.z) for p in cut.points_m]).tobytes())
    except (McapError, EOFError):
        pass
    return blades


def part(programs, endpoint, server, seconds, seed):
    """Hands, cuts and passers-by for a while; the surgeon and the memory of the server."""
    memory = Memory(server)
    surgeon = Surgeon(endpoint, seed, warm_up(seconds))
    crowd = Crowd(programs, endpoint, seed + 1)
    surgeon.thread.start()
    crowd.thread.start()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        check(server.poll() is None, "the server goes on")
        check(surgeon.failure is None, f"the surgeon goes on: {surgeon.failure}")
        time.sleep(0.5)
    return surgeon, crowd, memory


def warm_up(seconds):
    """Length of the warm-up of a part [s]."""
    return min(WARM_UP_S, WARM_UP_PART * seconds)


def main(bin_dir, out_dir, seconds, seed):
    programs = Programs(pathlib.Path(bin_dir).resolve(), pathlib.Path(out_dir).resolve())
    recordings = [programs.out / f"part-{n}.mcap" for n in (1, 2)]
    for recording in recordings:
        recording.unlink(missing_ok=True)
    endpoint = free_endpoint()
    before = ("env", settings_of_the_allocator()) if seconds / 2 - warm_up(seconds / 2) >= LONG_S else ()
    try:
        server = start(programs, endpoint, recordings[0], HERE / "block.toml", before=before)
        haptic = programs.haptic(endpoint, "--seconds", seconds + 120, "--quiet", log="hand.log")
        surgeon, crowd, memory = part(programs, endpoint, server, seconds / 2, seed)
        crowd.end()
        server.kill()
        killed = time.monotonic()
        server.wait()
        surgeon.stop.set()
        surgeon.thread.join(60)
        first = (surgeon, crowd, memory, {blade for at, blade in surgeon.acknowledged if at < killed - LOST_S})

        server = start(programs, endpoint, recordings[1], "--resume", recordings[0], before=before)
        surgeon, crowd, memory = part(programs, endpoint, server, seconds / 2, seed + 2)
        surgeon.end()
        crowd.end()
        check(haptic.poll() is None, "the haptic client has gone on across the restart")
        haptic.send_signal(signal.SIGINT)
        server.send_signal(signal.SIGINT)
        check(server.wait(60) == 0, "the server ends as it is told to")
        report = json.loads(haptic.communicate(timeout=60)[0])
        second = (surgeon, crowd, memory, {blade for _, blade in surgeon.acknowledged})
    finally:
        programs.end()

    for recording, (surgeon, crowd, memory, promised) in zip(recordings, (first, second)):
        lines = [f"{at:.1f},{kib}" for at, kib in memory.samples]
        recording.with_suffix(".memory.csv").write_text("\n".join(["time_s,memory_kib", *lines, ""]))
        found = replay(programs, recording)
        cuts = cuts_of(recording)
        slope, over = memory.slope(warm_up(seconds / 2))
        rss = [kib for _, kib in memory.samples]
        growth = "too short for a slope"
        if over >= LONG_S:
            growth = f"{slope / 1024:+.2f} MiB/h over {over:.0f} s"
        print(
            f"{recording.stem}: {found['found']['compared']} steps repeated bit for bit; {len(promised)} cuts promised, "
            f"{len(cuts)} in the recording; refused {surgeon.refused or 'none'}, "
            f"{surgeon.unanswered} unanswered, back to the whole {surgeon.restored} times; {crowd.killed} passers-by "
            f"killed; memory {rss[0] / 1024:.0f} to {rss[-1] / 1024:.0f} MiB, {growth}"
        )
        check(promised <= set(cuts), "every acknowledged cut is in the recording")
        check(len(cuts) == len(set(cuts)), "no cut was made twice")
        check(len(promised) > 0 and crowd.killed > 0, "something happened")
        if over >= LONG_S:
            check(slope < SLOPE_KIB_PER_HOUR, f"memory grows by {slope:.0f} KiB per hour")
        else:
            check(max(rss) < rss[0] + ROOM_KIB, f"memory stays within {ROOM_KIB} KiB of its start: {rss[0]}, {max(rss)}")
    loop = report["loop"]
    print(f"hand: {loop['rate_hz']:.1f} Hz, largest force {loop['max_force_n']:.2f} N")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4]) if len(sys.argv) > 4 else 1)
    exit_now(0)

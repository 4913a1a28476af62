"""Server and haptic client as two processes, with a 60 Hz surface subscriber beside them.

1. Twenty seconds: loop rate, contact rate, round trip, lost messages, slew limit.
2. The server is killed while the hand presses: force is zero within 200 ms, the client runs on, and
   when a server is back force comes again.
3. The client is killed: the server releases the tool and goes on.

    python tests/haptic/haptic.py BIN_DIR OUT_DIR [--seconds T]
"""

import argparse
import csv
import json
import pathlib
import signal
import socket
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
from bare_loop import Beside, real_time  # noqa: E402
from client import Session, check, exit_now, next_stats  # noqa: E402
from wire import server_pb2, surface_pb2  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENE = ROOT / "tests/python/scene.toml"
SLEW = 50.0
REAL_TIME = real_time()
FLAG_LOST = 1 << 2


class Programs:
    """Processes that end with the test, by their id."""

    def __init__(self, bin_dir, out_dir):
        self.bin, self.out, self.running = bin_dir, out_dir, []

    def start(self, name, *arguments, log, stdout=None, before=()):
        """A program whose stderr, and stdout unless it is wanted, go to the log."""
        with open(self.out / log, "wb") as file:
            command = [*before, self.bin / name, *map(str, arguments)]
            process = subprocess.Popen(command, stdout=stdout or file, stderr=file, stdin=subprocess.DEVNULL)
        self.running.append(process)
        return process

    def server(self, endpoint, log="server.log"):
        process = self.start("scindo", "run", SCENE, "--listen", endpoint, log=log)
        host, port = endpoint.removeprefix("tcp/").split(":")
        end = time.monotonic() + 20
        while time.monotonic() < end:
            check(process.poll() is None, f"the server runs; see {self.out / log}")
            with socket.socket() as probe:
                if probe.connect_ex((host, int(port))) == 0:
                    return process
            time.sleep(0.1)
        raise AssertionError("the server listens within 20 s")

    def haptic(self, endpoint, *more, log="haptic.log"):
        common = ("--device", "sim", "--tool", "probe", "--connect", endpoint, "--json", "--slew", SLEW)
        return self.start("scindo-haptic", *common, *more, log=log, stdout=subprocess.PIPE, before=REAL_TIME)

    def bare_loops(self, seconds):
        beside = Beside(seconds, REAL_TIME)
        self.running += beside.loops
        return beside

    def end(self):
        for process in self.running:
            if process.poll() is None:
                process.kill()
            process.wait()


def free_endpoint():
    port = subprocess.run([sys.executable, ROOT / "tests/free_port.py"], stdout=subprocess.PIPE, check=True).stdout
    return f"tcp/127.0.0.1:{int(port)}"


def summary_of(process, seconds):
    text, _ = process.communicate(timeout=seconds)
    check(process.returncode == 0, f"scindo-haptic ends with 0, not {process.returncode}")
    return json.loads(text)


def log_rows(file):
    with open(file, newline="") as text:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(text)]


def force(row):
    return (row["force_x_n"] ** 2 + row["force_y_n"] ** 2 + row["force_z_n"] ** 2) ** 0.5


def largest_step(rows):
    keys = ["force_x_n", "force_y_n", "force_z_n"]
    return max(sum((b[k] - a[k]) ** 2 for k in keys) ** 0.5 for a, b in zip(rows, rows[1:]))


def steady(programs, seconds):
    """Three processes for a while: server, haptic client, and this one with the surface."""
    endpoint = free_endpoint()
    server = programs.server(endpoint)
    session = Session(endpoint, "scindo", "main")
    surface, frames = session.subscribe("body/block/surface/frame", surface_pb2.SurfaceFrame)
    log = programs.out / "steady.csv"
    haptic = programs.haptic(endpoint, "--seconds", seconds, "--log", log)
    beside = programs.bare_loops(seconds)
    count, end = 0, time.monotonic() + seconds
    while time.monotonic() < end:
        count += frames.qsize()
        for _ in range(frames.qsize()):
            frames.get()
        time.sleep(0.2)
    report = summary_of(haptic, 60)
    share = beside.share()
    surface.undeclare()
    session.zenoh.close()
    loop, link = report["loop"], report["link"]
    print(
        f"loop {loop['rate_hz']:.1f} Hz (late p50 {loop['lateness_ms']['p50']:.3f}, p99 {loop['lateness_ms']['p99']:.3f} ms, "
        f"missed {loop['missed_ticks']}); contact {link['contact_rate_hz']:.0f} Hz, lost {link['contacts_lost']}; "
        f"pose to contact p50 {link['round_trip_ms']['p50']:.2f}, p99 {link['round_trip_ms']['p99']:.2f} ms; "
        f"largest force {loop['max_force_n']:.2f} N, largest step {loop['max_force_step_n']:.4f} N; "
        f"surface {count / seconds:.0f} Hz",
        flush=True,
    )
    rows = log_rows(log)
    scheduled = loop["ticks"] + loop["missed_ticks"]
    check(abs(scheduled / loop["seconds"] - 1000) < 5, "a deadline every millisecond")
    # What follows holds for the time that this machine gave: `share` of it to the core with the least.
    check(loop["rate_hz"] > 900 * share, "the loop keeps 1 kHz: nine ticks of ten that a bare loop gets")
    check(link["contact_rate_hz"] >= 200 * share, "contact at 200 Hz or more")
    check(link["contacts_refused"] == 0, "no contact message was refused")
    check(link["contacts_lost"] <= (1.01 - share) * link["contacts"], "at most one contact message of a hundred is lost")
    check(0 < link["round_trip_ms"]["p50"] < 20 / share, "the median round trip is below 20 ms")
    check(loop["max_force_n"] > 0.1, "the hand feels the block")
    check(loop["max_force_n"] <= 2.5 + 1e-9, "the clamp holds")
    check(loop["max_force_step_n"] <= SLEW * 1e-3 + 1e-9, "the slew limit holds")
    check(loop["device_faults"] == 0, "no device fault")
    check(len(rows) + loop["log_rows_dropped"] == loop["ticks"], "every tick is in the log")
    check(largest_step(rows) <= SLEW * 1e-3 + 1e-6 or loop["log_rows_dropped"] > 0, "and shows the same")
    check(count / seconds > 20 * share, "the surface is published beside it")
    check(server.poll() is None, "the server runs")
    return endpoint, server


def server_killed(programs, endpoint, server):
    """SIGKILL while the hand presses: zero within 200 ms; a new server is felt again."""
    for attempt in (1, 2, 3):
        rows, report, server = kill_while_pressing(programs, endpoint, server)
        # The last message of the first server: the longest time without a new one.
        known = [r for r in rows if r["time_s"] - rows[0]["time_s"] > 2 and r["contact_age_ms"] < 1e6]
        oldest = max(known, key=lambda r: r["contact_age_ms"])
        last = oldest["time_s"] - oldest["contact_age_ms"] * 1e-3
        pressed = force([r for r in rows if r["time_s"] <= last][-1])
        if pressed > 0.1:
            break
        # A machine that stood still for a tenth of a second has let the hand go before.
        print(f"attempt {attempt}: the hand did not press when the server died ({pressed:.3f} N)", flush=True)
    check(pressed > 0.1, "the hand pressed when the server died")
    # Ticks that the machine did not give in that time take the slew limit as much longer.
    window = [r for r in rows if last < r["time_s"] <= last + 0.2]
    given = last + 0.2 + 1e-3 * max(0, 200 - len(window))
    stale = next(r for r in rows if r["time_s"] > last and int(r["flags"]) & FLAG_LOST)
    after = [r for r in rows if given <= r["time_s"] < stale["time_s"] + 0.2]
    check(all(force(r) == 0 for r in after), "force is zero 200 ms after the last message")
    zero_ms = 1e3 * (next(r["time_s"] for r in rows if r["time_s"] > last and force(r) == 0) - last)
    check(largest_step(rows) <= SLEW * 1e-3 + 1e-6, "the ramp keeps the slew limit")
    felt_again = [r for r in rows if r["time_s"] - rows[0]["time_s"] > 12 and force(r) > 0.1]
    check(felt_again, "the new server is felt after free space")
    check(report["link"]["contact_streams"] >= 2, "two streams of contacts were seen")
    print(f"server killed: force zero {zero_ms:.0f} ms after its last message; felt again after its return", flush=True)
    return server


def kill_while_pressing(programs, endpoint, server):
    """The log and the report of a client whose server is killed and started again, and the new server."""
    log = programs.out / "killed.csv"
    hold = programs.out / "hold.csv"
    # Presses after two seconds, lifts off at 8 s, presses again at 12 s.
    hold.write_text(
        "at_s,x_m,y_m,z_m\n0,0.06,0.03,0.07\n1.5,0.06,0.03,0.07\n2.5,0.06,0.03,0.036\n7.5,0.06,0.03,0.036\n"
        "8.5,0.06,0.03,0.07\n12,0.06,0.03,0.07\n13,0.06,0.03,0.036\n16,0.06,0.03,0.036\n"
    )
    haptic = programs.haptic(endpoint, "--seconds", 16, "--log", log, "--path", hold, log="killed.log")
    time.sleep(5)
    server.send_signal(signal.SIGKILL)
    server.wait()
    time.sleep(1)
    again = programs.server(endpoint, log="server-again.log")
    report = summary_of(haptic, 60)
    return log_rows(log), report, again


def client_killed(programs, endpoint, server):
    """SIGKILL: the server releases the tool and goes on; the next client gets it."""
    session = Session(endpoint, "scindo", "main")
    haptic = programs.haptic(endpoint, log="client-killed.log")
    end = time.monotonic() + 10
    while owner(session) == "":
        check(time.monotonic() < end, "the client holds the tool within 10 s")
        time.sleep(0.1)
    held = owner(session)
    subscription, stats = session.subscribe("stats", server_pb2.Stats)
    haptic.send_signal(signal.SIGKILL)
    start = time.monotonic()
    while owner(session) != "":
        check(time.monotonic() < start + 10, "the tool is released within 10 s")
        time.sleep(0.02)
    seconds = time.monotonic() - start
    first = next_stats(stats)
    check(next_stats(stats, first.sim_step).sim_step > first.sim_step, "the simulation goes on")
    subscription.undeclare()
    session.zenoh.close()
    report = summary_of(programs.haptic(endpoint, "--seconds", 2, log="next-client.log"), 60)
    check(report["link"]["contacts"] > 100, "the next client holds the tool")
    check(server.poll() is None, "the server runs")
    print(f"client {held} killed: tool released after {seconds:.2f} s, server at step {first.sim_step} and going on")


def owner(session):
    info = session.ask("rpc/info", server_pb2.SessionInfo)
    return next(tool.owner for tool in info.tools if tool.id == "probe")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=20.0)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    programs = Programs(args.bin, args.out)
    try:
        endpoint, server = steady(programs, args.seconds)
        server = server_killed(programs, endpoint, server)
        client_killed(programs, endpoint, server)
    finally:
        programs.end()


if __name__ == "__main__":
    try:
        main()
    except (AssertionError, subprocess.TimeoutExpired, StopIteration) as error:
        print(f"haptic.py: {error!r}", file=sys.stderr)
        exit_now(1)
    exit_now(0)

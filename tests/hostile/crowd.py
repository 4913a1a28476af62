"""64 hostile clients at once, against the port of the page or that of zenoh, beside an honest haptic client, an honest
viewer and an honest browser, which must not notice.

    python tests/hostile/crowd.py BIN ARTIFACTS PORT PAGE_PORT page|zenoh

SCINDO_HOSTILE_SECONDS: how long the attack lasts (default 20).

`tests/run hostile` does it at both.
"""

import json
import os
import pathlib
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))

import attacks  # noqa: E402
from client import Session, check, exit_now  # noqa: E402
from hostile import PATIENCE, Watch, resident_mb  # noqa: E402
from wire import server_pb2, viewer_pb2  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
SECONDS = int(float(os.environ.get("SCINDO_HOSTILE_SECONDS", "20")))
QUIET_SECONDS = 15
CLIENTS_PER_KIND = 8
# Bounds: growth of the server's memory [MB], and of the time from a pose to its contact, as a multiple.
MEMORY_MB = 256
SLOWER = 2.0
# What two runs on a quiet machine differ by [ms].
NOISE_MS = 4.0


failures = []


def hold(condition, words):
    """One check; the others are made all the same."""
    if not condition:
        failures.append(words)
        print(f"FAILED  {words}")


class Browser:
    """A legal browser, which reads all that it gets, and says that it is there, as the page does."""

    def __init__(self, page):
        self.link = attacks.web_socket(page)
        self.bytes, self.open = 0, True
        threading.Thread(target=self.read, daemon=True).start()
        threading.Thread(target=self.breathe, daemon=True).start()

    def read(self):
        self.link.settimeout(PATIENCE)
        try:
            while data := self.link.recv(1 << 16):
                self.bytes += len(data)
        except OSError:
            pass
        self.open = False

    def breathe(self):
        while self.open:
            time.sleep(0.5)
            ping = viewer_pb2.ViewerUp(ping=viewer_pb2.ViewerPing(page_time_ms=1e3 * time.monotonic()))
            try:
                self.link.sendall(attacks.framed(ping.SerializeToString()))
            except OSError:
                self.open = False


def haptic(bin, port, name, seconds):
    """An honest haptic client; its summary when it has ended."""
    arguments = [f"{bin}/scindo-haptic", "--device", "sim", "--tool", f"probe-{name}", "--id", name, "--path", "press"]
    arguments += ["--target", "0.05,0.05,0.1", "--connect", f"tcp/127.0.0.1:{port}", "--seconds", str(seconds)]
    return subprocess.Popen([*arguments, "--json", "--quiet"], stdout=subprocess.PIPE)


def summary(client, seconds):
    out, _ = client.communicate(timeout=seconds + PATIENCE)
    check(client.returncode == 0, f"the honest haptic client ends with 0: {client.returncode}")
    return json.loads(out)


def attacked(kinds, bin, port, page, server, quiet_ms):
    """All kinds at once. The honest haptic client is there before them."""
    start, seconds = resident_mb(server.pid), SECONDS + 6
    watch, browser = Watch(f"tcp/127.0.0.1:{port}", "block"), Browser(page)
    client = haptic(bin, port, f"honest-{kinds[0].__name__}", seconds)
    time.sleep(3.0)
    crowd, since, most = {}, time.monotonic(), start
    try:
        for kind in kinds:
            command = [sys.executable, str(HERE / "attacks.py"), kind.__name__]
            command += map(str, [CLIENTS_PER_KIND, SECONDS, port, page])
            crowd[kind.__name__] = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        while client.poll() is None:
            check(server.poll() is None, "the server lives")
            most = max(most, resident_mb(server.pid))
            time.sleep(0.25)
        figures, gap = summary(client, seconds), watch.longest_gap(since)
        seen = browser.bytes
    finally:
        done = {name: finished(one) for name, one in crowd.items()}
    print("  " + ", ".join(f"{name} {count}" for name, count in done.items()))
    check(all(done.values()), f"every kind did something: {done}")
    loop, link = figures["loop"], figures["link"]
    p99 = link["round_trip_ms"]["p99"]
    print(
        f"  pose to contact p50 {link['round_trip_ms']['p50']:.1f} ms, p99 {p99:.1f} ms (quiet {quiet_ms:.1f} ms), "
        f"longest gap of contacts {link['longest_contact_gap_ms']:.0f} ms, of frames {1e3 * gap:.0f} ms, "
        f"memory {start:.0f} MB, {most - start:+.0f} MB, {seen >> 20} MB to the browser"
    )
    hold(loop["seconds"] > 0.9 * seconds and link["contacts"] > 0, "the honest hand feels on")
    hold(link["contact_streams"] == 1 and link["longest_contact_gap_ms"] < 1000, f"it is never cut off: {link}")
    hold(loop["touch_ticks"] > 0, "it touches the tissue")
    hold(browser.open and seen > 0, "the honest browser keeps its seat")
    hold(most - start <= MEMORY_MB, f"memory grows by at most {MEMORY_MB} MB, found {most - start:.0f} MB")
    hold(p99 <= SLOWER * quiet_ms + NOISE_MS, f"contacts are at most {SLOWER} times slower, found {p99:.1f} ms")
    browser.link.close()
    watch.session.zenoh.close()


def finished(attacker):
    """What an attacker did. The slow readers are stopped; they are ended here."""
    try:
        out, _ = attacker.communicate(timeout=30)
    except subprocess.TimeoutExpired:
        attacker.kill()
        out, _ = attacker.communicate()
    words = out.split()
    return int(words[-1]) if words else 0


def main():
    bin, keep, port, page = sys.argv[1], pathlib.Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    limit = 4 * SECONDS + 500
    threading.Timer(limit, lambda: (print(f"crowd.py: {limit} s are over", file=sys.stderr), exit_now())).start()
    arguments = [f"{bin}/scindo", "run", str(HERE / "block.toml")]
    arguments += ["--listen", f"tcp/127.0.0.1:{port}", "--viewer", f"127.0.0.1:{page}"]
    with open(keep / "crowd.log", "w") as out:
        server = subprocess.Popen(arguments, stdout=out, stderr=subprocess.STDOUT)
    try:
        end = time.monotonic() + PATIENCE
        while True:
            try:
                session = Session(f"tcp/127.0.0.1:{port}", "scindo", "main")
                break
            except Exception:
                check(server.poll() is None and time.monotonic() < end, "the server starts")
                time.sleep(0.2)
        session.ask("rpc/info", server_pb2.SessionInfo)
        session.zenoh.close()
        quiet = summary(haptic(bin, port, "quiet", QUIET_SECONDS), QUIET_SECONDS)["link"]["round_trip_ms"]
        print(f"quiet: pose to contact p50 {quiet['p50']:.1f} ms, p99 {quiet['p99']:.1f} ms")
        kinds = {"page": attacks.PAGE, "zenoh": attacks.NETWORK}[sys.argv[5]]
        print(f"{CLIENTS_PER_KIND * len(kinds)} hostile clients at the port of {sys.argv[5]} for {SECONDS} s:")
        attacked(kinds, bin, port, page, server, quiet["p99"])
        again = Session(f"tcp/127.0.0.1:{port}", "scindo", "main")
        again.ask("rpc/info", server_pb2.SessionInfo)
        print("a new client is welcome")
        check(not failures, "; ".join(failures))
    finally:
        if server.poll() is None:
            server.kill()
    exit_now(0)


if __name__ == "__main__":
    try:
        main()
    except AssertionError as error:
        print(f"crowd.py: {error}", file=sys.stderr)
        exit_now(1)

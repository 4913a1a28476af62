"""Many viewers behind two routers, beside a haptic client at the server's own port.

    python tests/fanout/fanout.py BIN ARTIFACTS SERVER_PORT ROUTER_PORT ROUTER_PORT

BIN: folder of the programs, with the example `crowd` below it. SCINDO_FANOUT_VIEWERS (default 16) and
SCINDO_FANOUT_SECONDS (default 5) make it larger, SCINDO_FANOUT_SCENE names another scene. Checks that every viewer sees
the surface, each frame once, and that the server sends it once per router, however many watch. Prints the time from a
pose to its contact alone and beside the viewers, and who used the processor: all of them share the cores here, so the
viewers' own share is part of what the hand feels.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
VIEWERS = int(os.environ.get("SCINDO_FANOUT_VIEWERS", "16"))
SECONDS = int(os.environ.get("SCINDO_FANOUT_SECONDS", "5"))
# Only something that hangs takes this long, however busy the machine is [s].
PATIENCE = 120
TICK = os.sysconf("SC_CLK_TCK")


def check(condition, words):
    if not condition:
        raise AssertionError(words)


def processor_s(pid):
    """Time that a process has used the processor [s]."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def sent_bytes(ports):
    """Bytes sent on the present connections to these ports."""
    where = " or ".join(f"sport = :{port}" for port in ports)
    told = subprocess.check_output(["ss", "-tinH", "state", "established", f"( {where} )"], text=True)
    return sum(map(int, re.findall(r"bytes_sent:(\d+)", told)))


def wait_for(path, words, process):
    end = time.monotonic() + PATIENCE
    while words not in path.read_text():
        check(process.poll() is None and time.monotonic() < end, f"'{words}' appears in {path}")
        time.sleep(0.1)


class Bench:
    """Server and routers, and what is started beside them."""

    def __init__(self, bin, keep, ports):
        self.bin, self.keep, self.ports, self.running = bin, keep, ports, {}

    def start(self, name, *command):
        log = self.keep / f"{name}.log"
        with open(log, "w") as out:
            self.running[name] = subprocess.Popen(list(map(str, command)), stdout=out, stderr=subprocess.STDOUT)
        return self.running[name], log

    def haptic(self, name):
        """Pose to contact of a hand that presses the block [ms], and who used the processor meanwhile [cores]."""
        arguments = ["--device", "sim", "--tool", f"probe-{name}", "--id", f"hand-{name}", "--path", "press"]
        arguments += ["--target", "0.05,0.05,0.1", "--connect", f"tcp/127.0.0.1:{self.ports[0]}"]
        arguments += ["--seconds", str(SECONDS), "--quiet", "--json"]
        since, before = time.monotonic(), {n: processor_s(p.pid) for n, p in self.running.items()}
        client = subprocess.Popen([self.bin / "scindo-haptic", *arguments], stdout=subprocess.PIPE)
        own = 0.0
        while client.poll() is None:
            check(time.monotonic() < since + SECONDS + PATIENCE, "the haptic client ends")
            try:
                own = processor_s(client.pid)
            except (OSError, IndexError):
                pass
            time.sleep(0.1)
        seconds = time.monotonic() - since
        used = {n: (processor_s(p.pid) - before[n]) / seconds for n, p in self.running.items()}
        check(client.returncode == 0, f"the haptic client ends with 0, found {client.returncode}")
        figures = json.loads(client.stdout.read())
        check(figures["loop"]["touch_ticks"] > 0, "it touches the block")
        check(figures["link"]["contact_streams"] == 1, f"it is never cut off: {figures['link']}")
        return figures["link"]["round_trip_ms"], {**used, "haptic client": own / seconds}

    def stop(self):
        for process in self.running.values():
            process.terminate()
        for process in self.running.values():
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def report(name, trip, used):
    shares = ", ".join(f"{who} {cores:.2f}" for who, cores in used.items())
    print(f"{name}: pose to contact p50 {trip['p50']:.1f} ms, p99 {trip['p99']:.1f} ms; cores used: {shares}")


def main():
    bin, keep = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    ports = list(map(int, sys.argv[3:6]))
    server_ports, bench = [ports[0], ports[0] + 1], Bench(bin, keep, ports)
    scene = os.environ.get("SCINDO_FANOUT_SCENE", HERE / "block.toml")
    try:
        server, log = bench.start("server", bin / "scindo", "run", scene, "--listen", f"tcp/127.0.0.1:{ports[0]}")
        wait_for(log, str(ports[0]), server)
        for i, port in enumerate(ports[1:]):
            ends = ["--listen", f"tcp/127.0.0.1:{port}", "--connect", f"tcp/127.0.0.1:{ports[0]}"]
            router, log = bench.start(f"router-{i + 1}", bin / "scindo", "router", *ends)
            wait_for(log, str(port), router)
        alone, used = bench.haptic("alone")
        report("alone", alone, used)
        routers = [f"tcp/127.0.0.1:{port}" for port in ports[1:]]
        crowd, log = bench.start("viewers", bin / "examples/crowd", VIEWERS, 2 * SECONDS + 10, *routers)
        wait_for(log, "watching", crowd)
        before = sent_bytes(server_ports), sent_bytes(ports[1:])
        beside, used = bench.haptic("beside")
        from_server, from_routers = (sent_bytes(p) - b for p, b in zip((server_ports, ports[1:]), before))
        report(f"beside {VIEWERS} viewers", beside, used)
        del bench.running["viewers"]
        crowd.wait(2 * SECONDS + 10 + PATIENCE)
        seen = json.loads(log.read_text().splitlines()[-1])
        rate = seen["frames_mean"] / seen["seconds"]
        print(
            f"{seen['viewers']} viewers: {rate:.1f} frames per second of {seen['vertices']} vertices each, at least "
            f"{seen['frames_least']} frames, longest gap {seen['longest_gap_ms']} ms; sent beside the hand: "
            f"{from_server / 1e6:.2f} MB by the server, {from_routers / 1e6:.2f} MB by the routers"
        )
        again, used = bench.haptic("again")
        report("alone again", again, used)
        quiet = max(alone["p99"], again["p99"])
        print(f"p99 of contact: {beside['p99'] / quiet:.2f} times the larger of the two alone")
        check(seen["viewers"] == VIEWERS and seen["frames_least"] > 0, f"every viewer sees the block move: {seen}")
        check(seen["repeated"] == 0, f"no frame comes twice, found {seen['repeated']} in {seen}")
        # Two routers take a surface once each, so the server sends a part of what the viewers receive.
        share = from_server / max(1, from_routers)
        check(share < 6 / VIEWERS + 0.25, f"the server sends a surface once per router: {share:.2f} of all bytes")
    finally:
        bench.stop()


if __name__ == "__main__":
    try:
        main()
    except AssertionError as error:
        sys.exit(f"fanout.py: {error}")

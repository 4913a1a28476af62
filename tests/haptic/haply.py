"""scindo-haptic on a Haply Inverse3, whose service is the stand-in `haply_service`: force in the hand, a service that is
killed while the hand presses, and that comes back.

    python tests/haptic/haply.py BIN_DIR OUT_DIR
"""

import csv
import json
import pathlib
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
from client import check, exit_now  # noqa: E402
from haptic import Programs, free_endpoint  # noqa: E402

GONE = 1 << 10
PATIENCE = 40.0


def lines(programs, log):
    """Heights [m] and forces [N] that the service has printed, whole lines only."""
    text = (programs.out / log).read_text()
    return [tuple(map(float, line.split())) for line in text.split("\n")[1:-1]]


def until(condition, what):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError(f"within {PATIENCE:g} s: {what}")


def main():
    programs = Programs(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
    endpoint = free_endpoint()
    address = free_endpoint().removeprefix("tcp/")
    rows = programs.out / "haply.csv"
    try:
        programs.server(endpoint, log="haply-server.log")
        service = programs.start("examples/haply_service", address, log="haply-1.log")
        until(lambda: "Inverse3" in (programs.out / "haply-1.log").read_text(), "the service listens")
        listed = subprocess.run([programs.bin / "scindo-haptic", "--device", "list", "--haply", address, "--json"],
                                stdout=subprocess.PIPE, check=True)
        found = [device["device"] for device in json.loads(listed.stdout)["devices"] if device["is_ready"]]
        check(f"haply:{address}/049D" in found, f"--device list finds it: {found}")

        command = ("--device", f"haply:{address}", "--tool", "probe", "--connect", endpoint, "--json", "--log", rows)
        client = programs.start("scindo-haptic", *command, log="haply-client.log", stdout=subprocess.PIPE)
        until(lambda: any(force > 0.2 for _, force in lines(programs, "haply-1.log")), "the hand feels the tissue")
        service.kill()
        service.wait()
        before = lines(programs, "haply-1.log")
        check(before[-1][0] < -0.01, "it was killed while the hand pressed")
        time.sleep(1.0)
        programs.start("examples/haply_service", address, log="haply-2.log")
        until(lambda: any(force > 0.2 for _, force in lines(programs, "haply-2.log")), "force again")
        after = lines(programs, "haply-2.log")
        client.terminate()
        summary = json.loads(client.communicate(timeout=PATIENCE)[0])
        check(client.returncode == 0 and summary["device"] == "haply-inverse3", f"it ends well: {summary['device']}")
        largest = max(force for _, force in before + after)
        check(largest <= 2.5 and summary["loop"]["max_force_n"] <= 2.5, f"no force above the limit: {largest}")
        pushed = [force for height, force in before + after if height > -0.005]
        check(max(map(abs, pushed)) < 0.05, "no force in the air")

        table = list(csv.DictReader(open(rows)))
        force = lambda row: max(abs(float(row[f"force_{axis}_n"])) for axis in "xyz")  # noqa: E731
        gone = [row for row in table if int(row["flags"]) & GONE and float(row["time_s"]) > 1.0]
        check(len(gone) > 500, f"{len(gone)} ticks without the device")
        check(all(force(row) == 0 for row in gone), "none of them with force")
        ticks = summary["loop"]["ticks"]
        print(f"haply: {ticks} ticks, {largest:.2f} N in the hand, {len(gone)} ticks without the device and force")
    finally:
        programs.end()


if __name__ == "__main__":
    main()
    exit_now(0)

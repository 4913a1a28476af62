"""What this machine gives a loop of 1 kHz that does nothing, on every core.

A machine that is shared takes its cores away now and then, and no program can keep a rate then. So a
rate is judged beside this one, in the same run: `Beside` starts a bare loop per core, at the priority
of the loop under test, and tells the rate of the one that got least.

    python tests/python/bare_loop.py --seconds T      prints the rates [Hz], then the least of them as a share
"""

import argparse
import os
import subprocess
import sys
import time

PERIOD_NS = 1_000_000
# Enough to see what a machine is like; more would be a load of their own.
MAX_CORES = 8


def rate_hz(seconds):
    """Deadlines that were met by less than a period, per second: as `scindo-haptic` counts its own."""
    start = deadline = time.monotonic_ns()
    end = start + int(seconds * 1e9)
    ticks = 0
    while deadline + PERIOD_NS <= end:
        deadline += PERIOD_NS
        time.sleep(max(0, deadline - time.monotonic_ns()) * 1e-9)
        deadline += max(0, time.monotonic_ns() - deadline) // PERIOD_NS * PERIOD_NS
        ticks += 1
    return ticks * 1e9 / (time.monotonic_ns() - start)


def real_time():
    """The command before a program that may have real-time priority here, as deploy/README.md advises."""
    command = ("chrt", "-f", "20")
    allowed = subprocess.run([*command, "true"], stderr=subprocess.DEVNULL, check=False).returncode == 0
    return command if allowed else ()


class Beside:
    """Bare loops that run beside something else for `seconds`, one per core."""

    def __init__(self, seconds, before=()):
        cores = sorted(os.sched_getaffinity(0))[:MAX_CORES]
        command = [*before, sys.executable, __file__, "--seconds", str(seconds), "--core"]
        self.loops = [subprocess.Popen([*command, str(core)], stdout=subprocess.PIPE) for core in cores]

    def share(self):
        """Of a thousand ticks per second, the part that the core with the fewest got: 0 to 1."""
        rates = [float(loop.communicate(timeout=60)[0]) for loop in self.loops]
        print("a bare loop of 1 kHz gets", ", ".join(f"{rate:.0f}" for rate in rates), "Hz on the cores here", flush=True)
        return min(1.0, min(rates) / 1000)

    def end(self):
        """Ends those that still run."""
        for loop in self.loops:
            if loop.poll() is None:
                loop.kill()
            loop.wait()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--core", type=int, help="only here: prints its rate [Hz]")
    args = parser.parse_args()
    if args.core is None:
        print(Beside(args.seconds, real_time()).share())
    else:
        os.sched_setaffinity(0, {args.core})
        print(rate_hz(args.seconds))

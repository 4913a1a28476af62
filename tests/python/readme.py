"""Runs the Python of README.md as it stands against a server, with nothing but the packages that it names.

    python tests/python/readme.py tcp/127.0.0.1:7447
"""

import ast
import pathlib
import re
import subprocess
import sys
import time

from client import Session

README = pathlib.Path(__file__).resolve().parents[2] / "README.md"
NAMED = {"zenoh", "numpy", "google"}


def wait_for_the_server(endpoint):
    """A reader of README.md has a server that runs; here it was started a moment ago."""
    session, end = Session(endpoint, "scindo", "main"), time.monotonic() + 60
    while not list(session.zenoh.get(session.key("rpc/schema"), timeout=2.0)):
        assert time.monotonic() < end, "no server answers"
        time.sleep(0.1)
    session.zenoh.close()


def main():
    wait_for_the_server(sys.argv[1])
    blocks = re.findall(r"^```python\n(.*?)^```$", README.read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) == 1, f"one block of Python in README.md: {len(blocks)}"
    imports = set()
    for node in ast.walk(ast.parse(blocks[0])):
        if isinstance(node, ast.Import):
            imports |= {name.name.split(".")[0] for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            imports.add(node.module.split(".")[0])
    foreign = imports - NAMED - set(sys.stdlib_module_names)
    assert not foreign, f"packages that README.md does not name: {foreign}"
    command = [sys.executable, "-c", blocks[0], *sys.argv[1:]]
    run = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=120, check=True)
    lines = run.stdout.splitlines()
    assert lines and lines[0].startswith("scene "), f"the scene first: {lines[:1]}"
    forces = [line for line in lines if line.startswith("forces [N]: [")]
    assert len(forces) == 1, f"the forces once: {forces}"
    lines.remove(forces[0])
    frames = [re.fullmatch(r" *([\d.]+) s: (\d+) points, centre \[.*\]", line) for line in lines[1:]]
    assert len(frames) >= 3 and all(frames), f"frames: {lines[1:6]}"
    times = [float(frame[1]) for frame in frames]
    assert times == sorted(times) and times[-1] > times[0], f"time goes on: {times}"
    print(f"README.md: {len(blocks[0].splitlines())} lines of Python saw {len(frames)} frames of {frames[0][2]} points")


if __name__ == "__main__":
    main()

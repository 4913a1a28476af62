"""Writes deploy/guide/gallery.md: a picture, the description and the measured cost of each scene that ships.

    python tests/gallery/page.py PROGRAM

A scene makes its first steps without pause on one thread. Its cost is processor time per step, without the first step
and what comes before it.
"""

import json
import os
import pathlib
import resource
import subprocess
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
SCENES = HERE.parents[1] / "server/world/scenes"
PAGE = HERE.parents[1] / "deploy/guide/gallery.md"
#: Steps that a cost is measured over.
STEPS = 60

INTRO = """# Gallery

These scenes come with the program. `scindo demo NAME` runs one and serves its page at <http://127.0.0.1:8080>. The menu
*View* of [the page](page.md) changes to another. Their files are in `server/world/scenes`, in a package in
`share/scindo/scenes`.

```sh
scindo demo --list
```

```text
{listed}
```

Costs are processor time per step on one core of {machine}: means over the first {steps} steps of
the scene, without its set-up, the better of two runs. A scene keeps up with real time if a step costs less time than it
simulates. [`scindo check FILE`](check.md) measures a scene on yours. `tests/gallery/page.py` measures the costs of this
page, and `tests/gallery/pictures.mjs` takes its pictures.
"""

ENTRY = """
## {name}

![{title}](pictures/gallery/{name}.jpg)

{description}

{cost} ms per step of {step} ms. `scindo demo {name}`
"""


def processor_s(program, name, steps):
    """Processor time of so many steps and of what comes before them [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [program, "run", SCENES / f"{name}.toml", "--fast", "--threads", "1", "--steps", str(steps)]
    # A scene may end with a warning code; it has made its steps all the same.
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def entry(program, name, description):
    scene = tomllib.loads((SCENES / f"{name}.toml").read_text())
    step_s = scene.get("world", {}).get("step_s", 0.02)
    costs_s = [processor_s(program, name, STEPS + 1) - processor_s(program, name, 1) for _ in range(2)]
    cost_ms = 1e3 * min(costs_s) / STEPS
    print(f"{name}: {cost_ms:.3g} ms per step", flush=True)
    words = {"name": name, "title": scene["name"], "description": description}
    return ENTRY.format(**words, cost=f"{float(f'{cost_ms:.2g}'):g}", step=f"{1e3 * step_s:g}")


def machine():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    model = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return f"an {model} with {os.cpu_count()} cores"


def main():
    program = sys.argv[1]
    said = subprocess.run([program, "demo", "--list", "--json"], capture_output=True, check=True).stdout
    scenes = json.loads(said)["scenes"]
    listed = "\n".join(f"{scene['name']} …" for scene in scenes[:3])
    page = INTRO.format(listed=listed, machine=machine(), steps=STEPS)
    PAGE.write_text(page + "".join(entry(program, scene["name"], scene["description"]) for scene in scenes))


if __name__ == "__main__":
    main()

"""Runs the Python of the guide and of the package's README as it stands, with nothing but the package.

SCINDO_BIN=target/debug python tests/python/readme.py
"""

import ast
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import scindo

ROOT = pathlib.Path(__file__).resolve().parents[2]
NAMED = {"scindo", "numpy"}


def blocks(file, language):
    """Blocks of code of one language."""
    return re.findall(rf"^```{language}(?: [^\n]*)?\n(.*?)^```$", file.read_text(), re.MULTILINE | re.DOTALL)


def run(code, folder, **more):
    """Lines that the code prints, if it imports only what it may."""
    imports = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            imports |= {name.name.split(".")[0] for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            imports.add(node.module.split(".")[0])
    foreign = imports - NAMED - set(sys.stdlib_module_names)
    assert not foreign, f"packages that the page does not name: {foreign}"
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, **more}, stdout=subprocess.PIPE, text=True, timeout=300, check=True
    )
    return done.stdout.splitlines()


def shapes(line):
    """The two shapes that a line ends with: points and triangles."""
    points, triangles = re.search(r"\((\d+), 3\) \((\d+), 3\)$", line).groups()
    return int(points), int(triangles)


def newtons(line):
    """The force of a tool in a line on forces."""
    return float(re.search(r"finger on \w+: ([\d.e-]+) N", line)[1])


def guide(folder):
    """The scene of the guide, served, touched, cut and run."""
    page = ROOT / "deploy/guide/python.md"
    (scene,) = blocks(page, "toml")
    (folder / "liver.toml").write_text(scene)
    (code,) = [code for code in blocks(page, "python") if "liver.toml" in code]
    first, forces, cut, last = run(code, folder)
    points, triangles = shapes(first)
    assert triangles == 2 * points - 4 > 500, f"a closed surface: {first}"
    assert newtons(forces) > 0.01, forces
    assert int(cut.removeprefix("cut elements: ")) > 0, cut
    status, count, _, stress = re.fullmatch(r"(\w+) \((\d+), (3)\) ([\d.]+)", last).groups()
    assert status == "done" and int(count) > 300 and float(stress) > 1.0, last
    return code


def package_readme(folder):
    """The lines of the package's README against a server of the demonstration's kind."""
    (code,) = blocks(ROOT / "client/python/README.md", "python")
    with scindo.serve(ROOT / "tests/python/scene.toml") as server:
        first, forces, cut = run(code, folder, SCINDO_CONNECT=server.endpoint)
    assert first.startswith("block block ") and shapes(first)[0] > 100, first
    assert newtons(forces) > 0.01, forces
    assert int(re.search(r"elements=(\d+)", cut)[1]) > 0, cut
    return code


if __name__ == "__main__":
    for test in (guide, package_readme):
        with tempfile.TemporaryDirectory() as folder:
            print(f"{test.__name__}: {len(test(pathlib.Path(folder)).splitlines())} lines of Python run")

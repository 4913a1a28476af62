"""Runs every command of the guide, compares what it prints, and builds its pages.

    python tests/guide/guide.py PROGRAMS PAGES [PAGE.md]...

A block of code is run in a folder of its page: `sh` by bash, `python` by this Python. `name=FILE` saves a block as a
file. `sh serve` starts a program that runs until the page ends; `sh fails` must end with an error. A block `text` after it
holds lines that must be printed in this order, with anything between them; … stands for anything within a line. A block
that no test machine can run says why: `sh not-run: REASON`.
"""

import html
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from markdown_it import MarkdownIt

ROOT = pathlib.Path(__file__).resolve().parents[2]
GUIDE = ROOT / "deploy" / "guide"
PATIENCE = 120.0
STYLE = """body { font: 17px/1.5 system-ui, sans-serif; margin: 0 auto; padding: 1rem; color: #222; max-width: 76rem }
main { max-width: 54rem } h1 { margin-top: 0 } code { font-size: 85% } img { max-width: 100% }
pre { background: #f4f4f2; padding: .7rem 1rem; white-space: pre-wrap; border-radius: 4px }
pre.says { background: none; border-left: 3px solid #ccc; border-radius: 0; color: #555 }
table { border-collapse: collapse; display: block; overflow-x: auto } td:first-child code { white-space: nowrap }
td, th { border-bottom: 1px solid #ddd; padding: .25rem .6rem; text-align: left; vertical-align: top }
nav { font-size: 85%; border-bottom: 1px solid #ddd; margin-bottom: 1.5rem } nav a { margin-right: .8rem; white-space: nowrap }
nav b { display: block; margin-top: .6rem } nav a.here { font-weight: bold; color: inherit; text-decoration: none }
@media (min-width: 70rem) { body { display: grid; grid-template-columns: 15rem 1fr; gap: 2.5rem }
nav { border: 0; position: sticky; top: 1rem; align-self: start } nav a { display: block; margin: .15rem 0 } }
@media (prefers-color-scheme: dark) { body { background: #1c1c1c; color: #ddd } pre { background: #2a2a2a }
pre.says { color: #aaa } a { color: #8ab4f8 } }"""


class Wrong(Exception):
    """What the guide says is not so."""


def check_lines(expected, printed, where):
    """Every expected line is printed, in this order."""
    lines = iter(printed.splitlines())
    for wanted in filter(None, map(str.strip, expected.splitlines())):
        pattern = re.compile(".*?".join(re.escape(part) for part in wanted.split("…")))
        if not any(pattern.search(line) for line in lines):
            raise Wrong(f"{where}: '{wanted}' is not printed, or not in this order:\n{printed}")


class Page:
    """The blocks of one page, run in order in one folder."""

    def __init__(self, file, folder, environment):
        self.file, self.folder, self.environment = file, folder, environment
        self.served, self.commands = [], 0

    def run(self, tokens):
        fences = [token for token in tokens if token.type == "fence"]
        for index, fence in enumerate(fences):
            info, _, reason = fence.info.partition("not-run:")
            language, *words = info.split()
            where = f"{self.file.relative_to(GUIDE)}, line {fence.map[0] + 1}"
            if "not-run:" in fence.info:
                if len(reason.split()) < 3:
                    raise Wrong(f"{where}: not-run needs a reason")
                continue
            following = fences[index + 1] if index + 1 < len(fences) else None
            expected = following.content if following is not None and following.info.strip() == "text" else ""
            name = next((word[5:] for word in words if word.startswith("name=")), None)
            if name is not None:
                (self.folder / name).write_text(fence.content)
            elif language in ("sh", "python"):
                self.commands += 1
                self.execute(language, words, fence.content, expected, where)
            elif language != "text":
                raise Wrong(f"{where}: nothing is done with a block of '{fence.info}'")

    def execute(self, language, words, code, expected, where):
        command = ["bash", "-euo", "pipefail", "-c", code] if language == "sh" else [sys.executable, "-c", code]
        if "serve" in words:
            return self.serve(command, expected, where)
        done = subprocess.run(
            command, cwd=self.folder, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True, timeout=PATIENCE,
        )  # fmt: skip
        if (done.returncode != 0) != ("fails" in words):
            raise Wrong(f"{where}: ended with {done.returncode}:\n{done.stdout}")
        if "panicked" in done.stdout:
            raise Wrong(f"{where}: {done.stdout}")
        return check_lines(expected, done.stdout, where)

    def serve(self, command, expected, where):
        log = self.folder / f"served-{len(self.served)}.log"
        with open(log, "w") as out:
            process = subprocess.Popen(
                command, cwd=self.folder, env=self.environment, stdout=out, stderr=subprocess.STDOUT, start_new_session=True
            )
        self.served.append(process)
        end = time.monotonic() + PATIENCE
        while True:
            try:
                return check_lines(expected, log.read_text(), where)
            except Wrong:
                if process.poll() is not None or time.monotonic() > end:
                    raise
                time.sleep(0.1)

    def end(self):
        for process in self.served:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
            process.wait(timeout=30)


def anchor(heading):
    """The anchor of a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def contents(here, up):
    """The list of pages with its headings, as seen from the page `here`."""
    links = []
    for heading, title, name in re.findall(r"^# (.+)|\[(.+?)\]\((.+?)\)", (GUIDE / "SUMMARY.md").read_text(), re.MULTILINE):
        mark = ' class="here"' if name == here else ""
        links.append(f"<b>{heading}</b>" if heading else f'<a{mark} href="{up}{name[:-3]}.html">{html.escape(title)}</a>')
    return "\n".join(links)


def build(pages, markdown, titles):
    """Writes the pages as HTML, with their pictures beside them."""
    pages.mkdir(parents=True, exist_ok=True)
    if (GUIDE / "pictures").is_dir():
        shutil.copytree(GUIDE / "pictures", pages / "pictures", dirs_exist_ok=True)

    def fence(renderer, tokens, index, options, env):
        kind = ' class="says"' if tokens[index].info.strip() == "text" else ""
        return f"<pre{kind}><code>{html.escape(tokens[index].content)}</code></pre>\n"

    markdown.add_render_rule("fence", fence)
    for name, title in titles:
        up = "../" * name.count("/")
        links = contents(name, up)
        body = markdown.render((GUIDE / name).read_text())
        body = re.sub(r'href="([\w./-]+)\.md(#[\w-]+)?"', r'href="\1.html\2"', body)
        body = re.sub(
            r"<(h\d)>(.*?)</\1>",
            lambda found: f'<{found[1]} id="{anchor(html.unescape(re.sub("<.*?>", "", found[2])))}">{found[2]}</{found[1]}>',
            body,
        )
        head = '<!doctype html><html lang="en"><meta charset="utf-8">'
        head += f'<meta name="viewport" content="width=device-width"><title>{html.escape(title)}</title><style>{STYLE}</style>'
        file = pages / f"{name[:-3]}.html"
        file.parent.mkdir(exist_ok=True)
        file.write_text(f"{head}<nav>{links}</nav><main>{body}</main>")
    (pages / "index.html").write_text(f'<meta http-equiv="refresh" content="0; url={titles[0][0][:-3]}.html">')


def main():
    programs, pages = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    titles = [(name, title) for title, name in re.findall(r"\[(.+?)\]\((.+?)\)", (GUIDE / "SUMMARY.md").read_text())]
    pages_there = {str(file.relative_to(GUIDE)) for file in GUIDE.rglob("*.md")} - {"SUMMARY.md"}
    if left_out := pages_there - {name for name, _ in titles}:
        raise Wrong(f"SUMMARY.md does not name {left_out}")
    markdown = MarkdownIt("commonmark").enable("table")
    path = os.pathsep.join([str(programs), str(pathlib.Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "SCINDO_BIN": str(programs / "scindo"), "NO_COLOR": "1"}
    for name, _ in titles:
        if sys.argv[3:] and name not in sys.argv[3:]:
            continue
        start = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            page = Page(GUIDE / name, pathlib.Path(folder), environment)
            try:
                page.run(markdown.parse(page.file.read_text()))
            finally:
                page.end()
        print(f"{name}: {page.commands} commands, {time.monotonic() - start:.0f} s", flush=True)
    build(pages, markdown, titles)


if __name__ == "__main__":
    try:
        main()
    except (Wrong, subprocess.TimeoutExpired) as error:
        sys.exit(f"guide: {error}")

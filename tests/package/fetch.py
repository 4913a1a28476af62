"""Fetches the page of a viewer as a browser does first: index.html, what it names, /healthz.

    python3 tests/package/fetch.py http://127.0.0.1:8080
"""

import json
import re
import sys
import time
import urllib.error
import urllib.request

# Only a server that hangs makes this take so long [s].
PATIENCE = 60.0


def get(url):
    with urllib.request.urlopen(url, timeout=10) as answer:
        return answer.read()


def healthy(base):
    """/healthz once the viewer hears a server."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            health = json.loads(get(f"{base}/healthz"))
            if health.get("page") != "built":
                sys.exit(f"the page was not built: {health}")
            return health
        except (urllib.error.URLError, ConnectionError) as error:
            if time.monotonic() > end:
                sys.exit(f"{base} does not answer: {error}")
            time.sleep(0.2)


def main():
    base = sys.argv[1].rstrip("/")
    health = healthy(base)
    page = get(f"{base}/").decode()
    named = re.findall(r'(?:src|href)="([^":#]+)"', page)
    if not any(name.endswith(".js") for name in named):
        sys.exit(f"the page names no program: {named}")
    sizes = {name: len(get(f"{base}/{name.lstrip('/')}")) for name in named}
    if min(sizes.values()) == 0:
        sys.exit(f"empty files: {sizes}")
    print(f"page: {len(page)} bytes, {sizes}; {health}")


if __name__ == "__main__":
    main()

#!/usr/bin/env bash
# What the tests need beside Rust: packages of Debian, a Python environment and packages of npm, the last two below
# $SCINDO_TEST_CACHE.
set -euo pipefail
cd "$(dirname "$0")/.."
cache=${SCINDO_TEST_CACHE:-$PWD/tests/.cache}
missing=()
for package in chromium iproute2 libgl1 libegl1 libosmesa6 libxrender1; do
  dpkg -s "$package" >/dev/null 2>&1 || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  if [ "$(id -u)" = 0 ]; then as_root=(); else as_root=(sudo); fi
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
fi
[ -x "$cache/venv/bin/python" ] || python3 -m venv "$cache/venv"
"$cache/venv/bin/python" -m pip install -q -r tests/python/requirements.txt
mkdir -p "$cache/browser"
cp tests/browser/package.json tests/browser/package-lock.json "$cache/browser/"
cd "$cache/browser"
npm ci --silent --no-audit --no-fund

#!/usr/bin/env bash
# The examples of the libraries, as CONTRIBUTING.md names them: each ends well and says what it should.
# Needs $SCINDO_TEST_BIN (folder of the programs, with the examples below it).
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}
says() { grep -q "$1" <<<"$2" || { echo "expected \"$1\" in:"; echo "$2"; exit 1; } >&2; }

found=$(timeout 60 "$bin/examples/cantilever")
says "at rest the tip hangs" "$found"
says "the blade met" "$found"
echo "cantilever: $(head -1 <<<"$found")"

found=$(timeout 60 "$bin/examples/scene")
says "1.00 s: corner at" "$found"
echo "scene: $(tail -1 <<<"$found")"

port=$(python3 tests/free_port.py)
log=$(mktemp)
"$bin/scindo" run server/world/scenes/first-cut.toml --listen "tcp/127.0.0.1:$port" >"$log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true; rm -f "$log"' EXIT
found=$(timeout 60 "$bin/examples/press" "tcp/127.0.0.1:$port")
says "contact planes" "$found"
says "cut: OUTCOME_APPLIED, [1-9]" "$found"
echo "press: $(tail -1 <<<"$found")"

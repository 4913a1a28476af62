#!/usr/bin/env bash
# Drives the page in a browser, one script after another; each says in its head what it does. Starts the server
# that a script works on, on free ports.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}/scindo
artifacts=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}
mkdir -p "$artifacts"
server=
trap 'stop' EXIT
stop() { [ -z "$server" ] || { kill "$server" 2>/dev/null || true; wait "$server" 2>/dev/null || true; server=; }; }

# serve NAME [ARGUMENT…]: starts scindo with a page; sets `url` and `server`.
serve() {
  local name=$1 web zenoh; shift
  web=$(python3 tests/free_port.py)
  zenoh=$(python3 tests/free_port.py)
  "$bin" "$@" --listen "tcp/127.0.0.1:$zenoh" --viewer "127.0.0.1:$web" >"$artifacts/$name-server.log" 2>&1 &
  server=$!
  url="http://127.0.0.1:$web"
  for _ in $(seq 1 300); do
    (exec 3<>"/dev/tcp/127.0.0.1/$web") 2>/dev/null && return
    kill -0 "$server" 2>/dev/null || { echo "the server ended:" >&2; tail -20 "$artifacts/$name-server.log" >&2; exit 1; }
    sleep 0.2
  done
}

serve browser
node tests/browser/viewer.mjs "$url"
stop
rm -rf "$artifacts/views-recordings"
serve views run tests/browser/views.toml --recordings "$artifacts/views-recordings"
node tests/browser/views.mjs "$url" "$server" "$bin" "$artifacts/views-recordings"
stop
serve hands run tests/browser/hands.toml
node tests/browser/hands.mjs "$url"
stop
serve textured run tests/browser/textured.toml
node tests/browser/textured.mjs "$url"
stop
serve headset run tests/browser/people.toml
node tests/browser/headset.mjs "$url"
stop

rm -f "$artifacts"/people-*.log
node tests/browser/people.mjs "$(dirname "$bin")" tests/browser/people.toml \
  "$(python3 tests/free_port.py)" "$(python3 tests/free_port.py)"

rm -rf "$artifacts/accuracy"
"$bin" accuracy --quick --budget-ms 20 --out "$artifacts/accuracy"
node tests/browser/accuracy.mjs "$artifacts/accuracy/index.html" r1 r2-tc1 bar-rest bar-motion

rm -rf "$artifacts/stress"
"$bin" stress --case step-sweep --out "$artifacts/stress"
node tests/browser/charts.mjs "$artifacts/stress/index.html"

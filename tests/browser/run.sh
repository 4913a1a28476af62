#!/usr/bin/env bash
# Starts the built-in demonstration on free ports and drives its page; see viewer.mjs. Looks at all views of
# another scene; see views.mjs. Lets two pages hold and cut the same tissue; see hands.mjs. Then makes a quick
# study of accuracy and looks at its page; see accuracy.mjs.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}/scindo
artifacts=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}
mkdir -p "$artifacts"
web=$(python3 tests/free_port.py)
zenoh=$(python3 tests/free_port.py)
"$bin" --listen "tcp/127.0.0.1:$zenoh" --viewer "127.0.0.1:$web" >"$artifacts/browser-server.log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true; wait "$server" 2>/dev/null || true' EXIT
for _ in $(seq 1 300); do
  (exec 3<>"/dev/tcp/127.0.0.1/$web") 2>/dev/null && break
  kill -0 "$server" 2>/dev/null || { echo "the server ended:" >&2; tail -20 "$artifacts/browser-server.log" >&2; exit 1; }
  sleep 0.2
done
node tests/browser/viewer.mjs "http://127.0.0.1:$web"
kill "$server"; wait "$server" 2>/dev/null || true

web=$(python3 tests/free_port.py)
zenoh=$(python3 tests/free_port.py)
"$bin" run tests/browser/views.toml --listen "tcp/127.0.0.1:$zenoh" --viewer "127.0.0.1:$web" >"$artifacts/views-server.log" 2>&1 &
server=$!
for _ in $(seq 1 300); do
  (exec 3<>"/dev/tcp/127.0.0.1/$web") 2>/dev/null && break
  kill -0 "$server" 2>/dev/null || { echo "the server ended:" >&2; tail -20 "$artifacts/views-server.log" >&2; exit 1; }
  sleep 0.2
done
node tests/browser/views.mjs "http://127.0.0.1:$web" "$server"
kill "$server"; wait "$server" 2>/dev/null || true

web=$(python3 tests/free_port.py)
zenoh=$(python3 tests/free_port.py)
"$bin" run tests/browser/hands.toml --listen "tcp/127.0.0.1:$zenoh" --viewer "127.0.0.1:$web" >"$artifacts/hands-server.log" 2>&1 &
server=$!
for _ in $(seq 1 300); do
  (exec 3<>"/dev/tcp/127.0.0.1/$web") 2>/dev/null && break
  kill -0 "$server" 2>/dev/null || { echo "the server ended:" >&2; tail -20 "$artifacts/hands-server.log" >&2; exit 1; }
  sleep 0.2
done
node tests/browser/hands.mjs "http://127.0.0.1:$web"

rm -rf "$artifacts/accuracy"
"$bin" accuracy --quick --budget-ms 20 --out "$artifacts/accuracy"
node tests/browser/accuracy.mjs "$artifacts/accuracy/index.html" r1 r2-tc1 bar-rest bar-motion

#!/usr/bin/env bash
# Hostile and slow clients against the real server: the others must not notice. Needs $SCINDO_TEST_BIN (folder
# of the programs) and $SCINDO_TEST_PYTHON.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}
python=${SCINDO_TEST_PYTHON:-python3}
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/hostile
mkdir -p "$keep"
ulimit -n 8192 2>/dev/null || true
port=$(python3 tests/free_port.py)
page=$(python3 tests/free_port.py)
timeout $((600 + ${SCINDO_HOSTILE_SECONDS:-8})) "$python" tests/hostile/hostile.py "$bin/scindo" "$keep" "$port" "$page"
timeout $((600 + 4 * ${SCINDO_HOSTILE_SECONDS:-20})) "$python" tests/hostile/crowd.py "$bin" "$keep" "$port" "$page" page
timeout $((600 + 4 * ${SCINDO_HOSTILE_SECONDS:-20})) "$python" tests/hostile/crowd.py "$bin" "$keep" "$port" "$page" zenoh

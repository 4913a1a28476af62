#!/usr/bin/env bash
# Many viewers behind two routers, beside a haptic client. Needs $SCINDO_TEST_BIN (folder of the programs, with the
# examples below it) and $SCINDO_TEST_PYTHON. SCINDO_FANOUT_VIEWERS=200 SCINDO_FANOUT_SECONDS=30 is the long form.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}
python=${SCINDO_TEST_PYTHON:-python3}
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/fanout
mkdir -p "$keep"
ulimit -n 16384 2>/dev/null || true
exec timeout $((900 + 8 * ${SCINDO_FANOUT_SECONDS:-5})) "$python" tests/fanout/fanout.py "$bin" "$keep" \
  "$(python3 tests/free_port.py)" "$(python3 tests/free_port.py)" "$(python3 tests/free_port.py)"

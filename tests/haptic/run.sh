#!/usr/bin/env bash
# Server and haptic client as two processes: rates, limits, and what happens when one is killed. Then a Haply device,
# whose service is a stand-in that goes and comes back.
# Needs $SCINDO_TEST_BIN (folder of the programs) and $SCINDO_TEST_PYTHON.
set -euo pipefail
cd "$(dirname "$0")/../.."
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/haptic
bin=${SCINDO_TEST_BIN:-target/debug} python=${SCINDO_TEST_PYTHON:-python3}
mkdir -p "$keep"
timeout 120 "$python" tests/haptic/haply.py "$bin" "$keep"
exec timeout 180 "$python" tests/haptic/haptic.py "$bin" "$keep" "$@"

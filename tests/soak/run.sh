#!/usr/bin/env bash
# A session that lasts: a recorded server with hands, cuts, clients that are killed, and a restart in the middle.
# Needs $SCINDO_TEST_BIN (folder of the programs) and $SCINDO_TEST_PYTHON. SCINDO_SOAK_SECONDS: how long (default 40).
set -euo pipefail
cd "$(dirname "$0")/../.."
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/soak
mkdir -p "$keep"
seconds=${SCINDO_SOAK_SECONDS:-40}
PYTHONPATH=client/python/src timeout $((600 + 3 * seconds)) "${SCINDO_TEST_PYTHON:-python3}" tests/soak/soak.py \
  "${SCINDO_TEST_BIN:-target/debug}" "$keep" "$seconds"

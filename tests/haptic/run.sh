#!/usr/bin/env bash
# Server and haptic client as two processes: rates, limits, and what happens when one is killed.
# Needs $SCINDO_TEST_BIN (folder of the programs) and $SCINDO_TEST_PYTHON.
set -euo pipefail
cd "$(dirname "$0")/../.."
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/haptic
exec timeout 180 "${SCINDO_TEST_PYTHON:-python3}" tests/haptic/haptic.py "${SCINDO_TEST_BIN:-target/debug}" "$keep" "$@"

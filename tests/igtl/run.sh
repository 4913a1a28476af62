#!/usr/bin/env bash
# The OpenIGTLink bridge against pyigtl, in both directions, with peers that vanish, lie and read nothing.
# Needs $SCINDO_TEST_BIN (folder of the programs) and $SCINDO_TEST_PYTHON.
set -euo pipefail
cd "$(dirname "$0")/../.."
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/igtl
mkdir -p "$keep"
exec timeout 300 "${SCINDO_TEST_PYTHON:-python3}" tests/igtl/igtl.py "${SCINDO_TEST_BIN:-target/debug}" "$keep"

#!/usr/bin/env bash
# The guide: every command in it is run, in a network namespace of its own, where the usual ports are free. Needs
# $SCINDO_TEST_BIN (folder of the programs) and $SCINDO_TEST_PYTHON with the package scindo. The pages go to
# $SCINDO_TEST_ARTIFACTS/guide.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}
python=${SCINDO_TEST_PYTHON:-python3}
pages=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/guide
alone=(unshare --net)
[ "$(id -u)" = 0 ] || alone=(unshare --user --map-root-user --net)
"${alone[@]}" true 2>/dev/null || { echo "guide: no network namespace can be made here; run it as root" >&2; exit 77; }
PYTHONPATH=$PWD/client/python/src "${alone[@]}" bash -c 'ip link set lo up && exec "$@"' guide \
  "$python" tests/guide/guide.py "$bin" "$pages" "$@"

#!/usr/bin/env bash
# Python against the real programs: the package client/python from an empty environment, a client that knows
# the wire only, and readers of the results. Needs $SCINDO_TEST_BIN (folder of the programs) and
# $SCINDO_TEST_PYTHON.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}
python=${SCINDO_TEST_PYTHON:-python3}
cache=${SCINDO_TEST_CACHE:-$PWD/tests/.cache}
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/python
mkdir -p "$keep"
server=
finish() { if [ -n "$server" ]; then kill "$server" 2>/dev/null || true; wait "$server" 2>/dev/null || true; fi; }
trap finish EXIT

echo "-- configurations of deploy/ load"
"$python" - <<'PY'
import pathlib, zenoh
for file in sorted(pathlib.Path("deploy").glob("*.json5")):
    config = zenoh.Config.from_file(str(file))
    config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
    zenoh.open(config).close()
    print(file)
PY

echo "-- package: messages, types, wheel"
client/python/generate "$python" --check
(cd client/python && "$python" -m mypy --cache-dir "$cache/mypy" src)
rm -rf "$keep/wheel"
"$python" -m pip wheel -q --no-deps --no-build-isolation -w "$keep/wheel" client/python
wheel=$(echo "$keep"/wheel/scindo-*.whl)

# An environment that has never held anything but the wheel and what it asks for.
empty=$cache/empty
wanted=$(sha256sum client/python/pyproject.toml | cut -d' ' -f1)
if [ "$(cat "$empty/wanted" 2>/dev/null)" != "$wanted" ]; then
  "$python" -m venv --clear "$empty"
  "$empty/bin/python" -m pip install -q "$wheel"
  echo "$wanted" >"$empty/wanted"
fi
"$empty/bin/python" -m pip install -q --no-deps --force-reinstall "$wheel"
"$empty/bin/python" -m pip check
export SCINDO_BIN=$bin

echo "-- package: READMEs, examples, tests"
"$empty/bin/python" tests/python/readme.py
for example in client/python/examples/*.py; do
  echo "$example"
  timeout 300 "$empty/bin/python" "$example"
done
timeout 900 "$empty/bin/python" -m unittest discover client/python/tests
# The oldest protobuf that the package promises to go with, in C and in pure Python.
floor=$(sed -n 's/.*"protobuf>=\([0-9.]*\)".*/\1/p' client/python/pyproject.toml)
[ -d "$cache/protobuf-$floor/google" ] ||
  "$empty/bin/python" -m pip install -q --no-deps --target "$cache/protobuf-$floor" "protobuf==$floor"
for implementation in upb python; do
  PROTOCOL_BUFFERS_PYTHON_IMPLEMENTATION=$implementation PYTHONPATH=$cache/protobuf-$floor \
    timeout 300 "$empty/bin/python" -m unittest client/python/tests/test_messages.py client/python/tests/test_mirror.py
done

echo "-- client over the network"
port=$(python3 tests/free_port.py)
"$bin/scindo" run tests/python/scene.toml --listen "tcp/127.0.0.1:$port" > "$keep/server.log" 2>&1 &
server=$!
"$python" tests/python/client.py --connect "tcp/127.0.0.1:$port"
kill -0 "$server" || { echo "the server did not survive; see $keep/server.log" >&2; exit 1; }
finish
server=

echo "-- results on disk"
timeout 600 "$python" tests/python/recording.py "$bin/scindo" "$keep/recording"

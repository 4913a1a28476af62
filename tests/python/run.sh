#!/usr/bin/env bash
# The public Python packages against the real programs: a client over the network, and readers of
# the results. Needs $SCINDO_TEST_BIN (folder of the programs) and $SCINDO_TEST_PYTHON; with a folder of
# real meshes in $SCINDO_MODELS it runs those instead of a dirty surface made here.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}
python=${SCINDO_TEST_PYTHON:-python3}
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/python
models=${SCINDO_MODELS:-made}
steps=${SCINDO_MODEL_STEPS:-100}
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

echo "-- client over the network"
port=$(python3 tests/free_port.py)
"$bin/scindo" run tests/python/scene.toml --listen "tcp/127.0.0.1:$port" > "$keep/server.log" 2>&1 &
server=$!
"$python" tests/python/readme.py "tcp/127.0.0.1:$port"
"$python" tests/python/client.py --connect "tcp/127.0.0.1:$port"
kill -0 "$server" || { echo "the server did not survive; see $keep/server.log" >&2; exit 1; }
finish
server=

echo "-- results on disk"
timeout 1500 "$python" tests/python/models.py "$bin/scindo" "$models" "$keep" --steps "$steps"

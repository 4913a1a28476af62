#!/usr/bin/env bash
# The recipe of deploy/README.md between two network namespaces: the server on one "machine", the
# viewer and the haptic client on another, joined by a virtual cable. Checks that the viewer serves the
# page and live frames, and that the haptic client keeps its rates. Needs root (ip netns), curl and
# $SCINDO_TEST_BIN; ends only what it started and removes its namespaces. Bounded to two minutes.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=$(realpath "${SCINDO_TEST_BIN:-target/debug}")
python=${SCINDO_TEST_PYTHON:-python3}
keep=${SCINDO_TEST_ARTIFACTS:-$PWD/tests/artifacts}/netns
scene=${1:-$PWD/tests/python/scene.toml}
fail() { echo "two_machines.sh: $*" >&2; exit 1; }

[ "$(id -u)" = 0 ] || { echo "two_machines.sh: network namespaces need root; run it with sudo" >&2; exit 77; }
command -v ip >/dev/null || fail "the program ip is missing: apt-get install iproute2"
for p in scindo scindo-view scindo-haptic; do [ -x "$bin/$p" ] || fail "$bin/$p is missing: cargo build --workspace"; done
mkdir -p "$keep"

# Names of at most 15 characters, unique to this run.
tag=$(printf '%05d' $(($$ % 100000)))
server_ns=scindo-s$tag client_ns=scindo-c$tag server_if=ss$tag client_if=sc$tag
server_ip=10.219.7.1 client_ip=10.219.7.2
pids=()
cleanup() {
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  for pid in "${pids[@]}"; do wait "$pid" 2>/dev/null || true; done
  ip netns del "$server_ns" 2>/dev/null || true
  ip netns del "$client_ns" 2>/dev/null || true
}
trap cleanup EXIT
trap 'exit 1' INT TERM

ip netns add "$server_ns"
ip netns add "$client_ns"
ip link add "$server_if" netns "$server_ns" type veth peer name "$client_if" netns "$client_ns"
ip -n "$server_ns" addr add "$server_ip/24" dev "$server_if"
ip -n "$client_ns" addr add "$client_ip/24" dev "$client_if"
for side in "$server_ns $server_if" "$client_ns $client_if"; do
  read -r ns interface <<<"$side"
  ip -n "$ns" link set lo up
  ip -n "$ns" link set "$interface" up
done

until_true() { # seconds, command: tries four times a second
  local end=$((SECONDS + $1)); shift
  until "$@" >/dev/null 2>&1; do
    [ $SECONDS -lt $end ] || return 1
    sleep 0.25
  done
}

on_server() { ip netns exec "$server_ns" "$@"; }
on_client() { ip netns exec "$client_ns" "$@"; }

# --- the recipe, as in deploy/README.md ---
ip netns exec "$server_ns" "$bin/scindo" run "$scene" --listen tcp/0.0.0.0:7447 >"$keep/server.log" 2>&1 &
pids+=($!)
reachable() { on_client "$python" -c "import socket; socket.create_connection(('$server_ip', 7447), 1)"; }
until_true 30 reachable || fail "the server is not reachable at $server_ip:7447; see $keep/server.log"

ip netns exec "$client_ns" "$bin/scindo-view" --connect "tcp/$server_ip:7447" --listen 127.0.0.1:8080 >"$keep/viewer.log" 2>&1 &
pids+=($!)
health() { on_client "$python" -c "import urllib.request as u; print(u.urlopen('http://127.0.0.1:8080/healthz', timeout=2).read().decode())"; }
until_true 30 health || fail "the viewer does not answer at /healthz; see $keep/viewer.log"

# Real time, as the recipe advises, where this is allowed.
chrt -f 20 true 2>/dev/null && real_time=(chrt -f 20) || real_time=()
on_client timeout 60 "${real_time[@]}" "$bin/scindo-haptic" --device sim --tool probe --connect "tcp/$server_ip:7447" \
  --seconds 8 --json >"$keep/haptic.json" 2>"$keep/haptic.log" &
haptic=$!
pids+=("$haptic")
"$python" tests/python/bare_loop.py --seconds 8 >"$keep/bare_loop.txt" &
bare=$!
pids+=("$bare")
on_client timeout 60 "$python" tests/netns/viewer_frames.py 127.0.0.1 8080 3 || fail "the viewer serves no frames"
wait "$haptic" || fail "scindo-haptic failed: $(cat "$keep/haptic.log")"
wait "$bare" || fail "the bare loop failed"
cat "$keep/bare_loop.txt"
echo "viewer: $(health)"

"$python" - "$keep/haptic.json" "$keep/bare_loop.txt" <<'PY'
import json, sys
report = json.load(open(sys.argv[1]))
# What this machine gave a loop that does nothing, of a thousand ticks per second.
share = float(open(sys.argv[2]).read().split()[-1])
loop, link = report["loop"], report["link"]
print(f"haptic client: loop {loop['rate_hz']:.0f} Hz, contact {link['contact_rate_hz']:.0f} Hz, lost {link['contacts_lost']}, "
      f"round trip p50 {link['round_trip_ms']['p50']:.2f} ms, p99 {link['round_trip_ms']['p99']:.2f} ms, "
      f"largest force {loop['max_force_n']:.2f} N")
assert loop["rate_hz"] > 900 * share, "the loop keeps 1 kHz: nine ticks of ten that a bare loop gets"
assert link["contact_rate_hz"] >= 200 * share, "contact at 200 Hz or more"
assert loop["max_force_n"] > 0.1, "the hand feels the body"
PY
for pid in "${pids[@]:0:2}"; do kill -0 "$pid" 2>/dev/null || fail "a program ended early; see $keep"; done
echo "two machines: passed"

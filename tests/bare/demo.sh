#!/usr/bin/env bash
# deploy/demo on a machine that has Rust and nothing else: a bare Debian root with rustup's folders, a clone of
# HEAD, an empty target folder and an empty npm cache. Takes as long as a first build. A person runs it; it needs root.
#   tests/bare/demo.sh
# SCINDO_BARE_TARGET: a folder to build in instead of an empty one.
set -euo pipefail
cd "$(dirname "$0")/../.."
. tests/bare/root.sh
cargo_home=${CARGO_HOME:-$HOME/.cargo} rustup_home=${RUSTUP_HOME:-$HOME/.rustup}

mkdir -p "$root/src"
git archive HEAD | tar -x -C "$root/src"
# First without cargo: the script must say what to do.
if in_root /src/deploy/demo >"$root/root/none.log" 2>&1 || ! grep -q rustup "$root/root/none.log"; then
  echo "deploy/demo does not say what to do without cargo" >&2
  exit 1
fi
bind "$rustup_home" /root/.rustup
bind "$cargo_home/bin" /root/.cargo/bin
# The machine's own way to the package registries.
for file in /etc/resolv.conf /etc/hosts /etc/apt/apt.conf.d /etc/apt/sources.list /etc/apt/sources.list.d \
  "$cargo_home/config.toml" "$HOME/.npmrc" /usr/local/share/ca-certificates /etc/ssl/certs; do
  [ -e "$file" ] || continue
  mkdir -p "$root$(dirname "$file")"
  cp -aL "$file" "$root$(dirname "$file")/"
done
[ -z "${SCINDO_BARE_TARGET:-}" ] || bind "$SCINDO_BARE_TARGET" /src/target
environment=()
while IFS='=' read -r name value; do environment+=("$name=$value"); done < <(env | grep -iE '^(https?_proxy|no_proxy|cargo_http_|npm_config_|ssl_cert|node_extra_ca)' || true)

start=$SECONDS
: >"$pristine.demo.log"
web=$(python3 tests/free_port.py)
become_in_root "${environment[@]}" /src/deploy/demo --listen "tcp/127.0.0.1:$(python3 tests/free_port.py)" \
  --viewer "$web" --seconds 7200 >"$pristine.demo.log" 2>&1 &
started=$!
until grep -q "viewer  " "$pristine.demo.log"; do
  kill -0 "$started" 2>/dev/null || { tail -30 "$pristine.demo.log" >&2; exit 1; }
  sleep 1
done
python3 tests/package/fetch.py "http://127.0.0.1:$web"
echo "deploy/demo: from clone to page in $((SECONDS - start)) s on $suite; $(grep "Built in" "$pristine.demo.log")"

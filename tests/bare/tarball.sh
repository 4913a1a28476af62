#!/usr/bin/env bash
# A package on a machine that has nothing: unpacks the tarball in a bare Debian root without Node.js or a compiler,
# runs the demonstration, fetches its page; then the same with the .deb. A person runs it; it needs root.
#   tests/bare/tarball.sh [DIR of deploy/package, default: package]
set -euo pipefail
cd "$(dirname "$0")/../.."
packages=$(cd "${1:-package}" && pwd)
. tests/bare/root.sh

demonstrate() {
  local web
  web=$(python3 tests/free_port.py)
  become_in_root "$@" --listen "tcp/127.0.0.1:$(python3 tests/free_port.py)" --viewer "$web" --seconds 600 &
  started=$!
  python3 tests/package/fetch.py "http://127.0.0.1:$web"
  [ -z "${SCINDO_BARE_PICTURE:-}" ] || chromium --headless --no-sandbox --disable-gpu --use-angle=swiftshader \
    --enable-unsafe-swiftshader --window-size=1440,900 --timeout=30000 --virtual-time-budget=20000 \
    --screenshot="$SCINDO_BARE_PICTURE" "http://127.0.0.1:$web" >/dev/null 2>&1
  kill -TERM "$started"
  wait "$started" || true
  started=
}

start=$SECONDS
cp "$packages"/*.tar.gz "$root/root/scindo.tar.gz"
in_root tar -xzf /root/scindo.tar.gz -C /opt
demonstrate /bin/sh -c 'exec /opt/scindo-*/bin/scindo "$@"' scindo
echo "tarball: from file to page in $((SECONDS - start)) s on $suite without Node.js"

start=$SECONDS
cp "$packages"/*.deb "$root/root/scindo.deb"
in_root dpkg -i /root/scindo.deb >/dev/null
in_root getent passwd scindo >/dev/null || { echo "the package made no user" >&2; exit 1; }
demonstrate /usr/bin/scindo
echo "deb: from file to page in $((SECONDS - start)) s"

#!/usr/bin/env bash
# Packs the programs that are built already and looks at what is inside: files, page, man pages, unit, and that
# the programs run from where they were unpacked. Needs $SCINDO_TEST_BIN (folder of the programs).
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${SCINDO_TEST_BIN:-target/debug}
scratch=$(mktemp -d)
server=
finish() {
  if [ -n "$server" ]; then kill "$server" 2>/dev/null || true; wait "$server" 2>/dev/null || true; fi
  rm -rf "$scratch"
}
trap finish EXIT
fail() { echo "package: $*" >&2; exit 1; }

PYTHON=${SCINDO_TEST_PYTHON:-python3} deploy/package --quick --programs "$bin" --out "$scratch/out"
tarball=$(echo "$scratch"/out/*.tar.gz) deb=$(echo "$scratch"/out/*.deb)
mkdir "$scratch/tree" "$scratch/deb"
tar -xzf "$tarball" -C "$scratch/tree" --strip-components 1
dpkg-deb -x "$deb" "$scratch/deb"

for root in "$scratch/tree" "$scratch/deb/usr"; do
  for file in bin/{scindo,scindo-papers,scindo-view,scindo-haptic,scindo-igtl} share/man/man1/scindo{,-run,-stress,-view,-haptic,-igtl}.1.gz \
    share/bash-completion/completions/scindo-haptic share/zsh/site-functions/_scindo \
    share/fish/vendor_completions.d/scindo-view.fish share/scindo/scenes/KEYS.md \
    share/scindo/scenes/first-cut.toml share/scindo/proto/scindo/v1/server.proto share/doc/scindo/LICENSE-MIT \
    share/doc/scindo/guide/{first-scene,troubleshooting,scene/cutting}.md share/doc/scindo/guide/pictures/cells.png \
    share/doc/scindo/guide/pictures/gallery/kidney.jpg share/scindo/scenes/organ.obj \
    lib/systemd/system/scindo.service; do
    [ -s "$root/$file" ] || fail "$file is missing below $root"
  done
  wheel=$(echo "$root"/share/scindo/scindo-*-py3-none-any.whl)
  python3 -m zipfile -t "$wheel" >/dev/null || fail "no wheel of the Python package below $root"
  grep -q viewer <<<"$(zcat "$root/share/man/man1/scindo-run.1.gz")" || fail "the man page of run does not tell of --viewer"
  [ -z "$(find "$root" -name '*.rs' -o -name node_modules)" ] || fail "sources are inside"
done
for file in etc/scindo/scene.toml etc/scindo/open-lab.json5; do
  [ -s "$scratch/deb/$file" ] || fail "$file is missing in the .deb"
done
# The unit of the package starts what the package brings.
unit=$scratch/deb/usr/lib/systemd/system/scindo.service
for path in $(sed -n 's/^ExecStart=//p' "$unit" | tr ' ' '\n' | grep ^/); do
  [ -e "$scratch/deb$path" ] || fail "the unit names $path, which the package does not bring"
done
# systemd understands every line of the unit, and finds it well shut in: 10 is wide open, 2.2 was without its last lines.
if command -v systemd-analyze >/dev/null; then
  sed "s|^ExecStart=/usr/bin/scindo|ExecStart=$(realpath "$scratch/deb/usr/bin/scindo")|" "$unit" >"$scratch/scindo.service"
  systemd-analyze verify "$scratch/scindo.service" || fail "systemd does not understand the unit"
  systemd-analyze security --offline=yes --threshold=20 --no-pager "$scratch/scindo.service" >"$scratch/security" ||
    { tail -3 "$scratch/security" >&2; fail "the unit is open wider than 2.0"; }
  grep -i overall "$scratch/security"
fi
[ "$(dpkg-deb -f "$deb" Version)" = "$("$bin/scindo" --version | cut -d' ' -f2)" ] || fail "version of the .deb"
"$scratch/deb/usr/bin/scindo" check "$scratch/deb/etc/scindo/scene.toml" >/dev/null || fail "the scene of the unit"
grep -q free-fall <<<"$("$scratch/tree/bin/scindo" stress --list)" || fail "scindo does not find scindo-papers beside it"
bash -n "$scratch/tree/share/bash-completion/completions/scindo" || fail "completions for bash"

# The demonstration from the unpacked tarball, its page fetched.
web=$(python3 tests/free_port.py)
"$scratch/tree/bin/scindo" --listen "tcp/127.0.0.1:$(python3 tests/free_port.py)" --viewer "$web" \
  >"$scratch/server.log" 2>&1 &
server=$!
python3 tests/package/fetch.py "http://127.0.0.1:$web" || { cat "$scratch/server.log" >&2; fail "no page"; }
kill -TERM "$server"; wait "$server" || fail "the demonstration ended with $?"
server=
echo "package: $(tar -tzf "$tarball" | wc -l) files, $(du -h "$tarball" | cut -f1) and $(du -h "$deb" | cut -f1) without optimisation"

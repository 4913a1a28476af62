#!/usr/bin/env bash
# The page from nothing: runs client/viewer/build.rs by itself, as on a machine that never ran npm.
# Then the ways in which it can fail: each is an error in CI, and elsewhere a page that names the cause.
set -euo pipefail
cd "$(dirname "$0")/../.."
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
# The build script needs nothing but the standard library.
rustc --edition 2024 --crate-name build_page -o "$scratch/build_page" client/viewer/build.rs

# attempt NAME VARIABLE=VALUE…: one run with an empty cache of npm; its output in $scratch/NAME.log
attempt() {
  local name=$1; shift
  mkdir -p "$scratch/$name/out" "$scratch/$name/cache"
  env -u CI -u SCINDO_SKIP_WEB -u SCINDO_REQUIRE_WEB CARGO_MANIFEST_DIR="$PWD/client/viewer" \
    OUT_DIR="$scratch/$name/out" npm_config_cache="$scratch/$name/cache" "$@" \
    "$scratch/build_page" >"$scratch/$name.log" 2>&1
}
fail() { echo "page: $*" >&2; cat "$scratch"/*.log >&2; exit 1; }
says() { grep -q "$2" "$scratch/$1/out/page/index.html" || fail "the page of advice ($1) does not say: $2"; }

attempt cold CI=true || fail "not built with an empty cache of npm"
for file in index.html viewer.js; do
  [ -s "$scratch/cold/out/page/$file" ] || fail "$file is missing"
done

# A path with a C library and a shell but without npm; a registry that nobody serves.
mkdir "$scratch/bin"
attempt no-npm PATH="$scratch/bin" || fail "without npm the build must go on"
says no-npm "npm was not found"
grep -q "cargo:warning=.*npm was not found" "$scratch/no-npm.log" || fail "no warning without npm"
! attempt no-npm-ci PATH="$scratch/bin" CI=true || fail "without npm CI must fail"
! attempt no-npm-required PATH="$scratch/bin" SCINDO_REQUIRE_WEB=1 || fail "SCINDO_REQUIRE_WEB=1 must fail without npm"

printf '#!/bin/sh\necho v16.20.2\n' >"$scratch/bin/node"; printf '#!/bin/sh\necho 8.19.4\n' >"$scratch/bin/npm"
chmod +x "$scratch/bin/node" "$scratch/bin/npm"
attempt old-node PATH="$scratch/bin:$PATH" || fail "with an old Node.js the build must go on"
says old-node "older than 18"

attempt no-network npm_config_registry=http://127.0.0.1:9 || fail "without a network the build must go on"
says no-network "did not reach its package registry"

attempt skipped SCINDO_SKIP_WEB=1 CI=true || fail "a page left out on purpose is no error"
says skipped "left out on purpose"
echo "page: built with an empty cache of npm; four failures named"

#!/usr/bin/env bash
# deploy/release in a clone: what it refuses, what a dry run leaves behind, what a release is. Packs the programs that are
# built already. Needs $SCINDO_TEST_BIN (folder of the programs).
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=$(cd "${SCINDO_TEST_BIN:-target/debug}" && pwd)
export PYTHON=${SCINDO_TEST_PYTHON:-python3}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
fail() { echo "release: $*" >&2; exit 1; }

# A clone with the files as they are now, so that the test needs no commit.
git clone -q --no-hardlinks . "$scratch/clone"
cp -r deploy/. "$scratch/clone/deploy/"
cp -r client/program/. "$scratch/clone/client/program/"
cd "$scratch/clone"
git config user.name tester
git config user.email tester@localhost
git checkout -q -B main
git add -A
git commit -q --allow-empty -m "As it is now"
state() { git rev-parse HEAD; git tag; git status --porcelain; }
before=$(state)
version=$("$bin/scindo" --version | cut -d' ' -f2)

# refuses WORDS ARGUMENTS...: ends with an error that says WORDS, and changes nothing.
refuses() {
  local words=$1 said
  shift
  ! said=$(deploy/release "$@" 2>&1) || fail "released: $*"
  grep -q "$words" <<<"$said" || fail "'$words' is not in: $said"
  [ "$(state)" = "$before" ] || fail "something changed: $(state)"
}
packed=(--programs "$bin" --quick --out "$scratch/out")
refuses "write it like" 1.2 --tests true
refuses "older than" 0.0.1 --tests true
refuses "tests failed" "$version" --tests false "${packed[@]}"
refuses "programs are not 99.0.0" 99.0.0 --tests true "${packed[@]}"
refuses "unknown argument" "$version" --dryrun
touch stray
before=$(state) refuses "differ from the last commit" "$version" --tests true "${packed[@]}"
rm stray
git tag "v$version"
before=$(state) refuses "exists" "$version" --tests true "${packed[@]}"
git tag -d "v$version" >/dev/null

deploy/release "$version" --dry-run --tests "grep -q '^## $version (' deploy/CHANGELOG.md" "${packed[@]}" >"$scratch/said"
[ "$(state)" = "$before" ] || fail "a dry run changed something: $(state)"
(cd "$scratch/out" && sha256sum --quiet -c SHA256SUMS && [ "$(wc -l <SHA256SUMS)" = 3 ]) || fail "checksums"

deploy/release "$version" --tests true "${packed[@]}" >"$scratch/said"
[ "$(git tag)" = "v$version" ] || fail "no tag"
[ -z "$(git status --porcelain)" ] || fail "files differ after a release"
[ "$(git log -1 --format=%s)" = "Release $version" ] || fail "no commit"
# Not through a pipe: grep would close it at its first match, and git would fail on what it still has to write.
contents=$(git tag -l --format='%(contents)' "v$version")
grep -q "^- " <<<"$contents" || fail "the tag does not say what is new: $contents"
before=$(state) refuses "says nothing" "${version%.*}.99" --tests true "${packed[@]}"
echo "release: $(head -1 "$scratch/said")"

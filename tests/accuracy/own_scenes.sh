#!/usr/bin/env bash
# Whether `scindo accuracy SCENE --budget-ms 10 --within 3m` keeps its word on twenty scenes that are no
# reference case: each recommendation is run again and compared with runs on meshes up to eight times finer.
# Run by a person on a quiet machine: an hour for the studies, and the finer runs.
#
#   tests/accuracy/own_scenes.sh [SCENE]...      default: the scenes below, five that ship and fifteen here
#   BUDGET_MS=10 WITHIN_S=180 OUT=/tmp/own_scenes
set -euo pipefail
cd "$(dirname "$0")/../.."
ships=server/world/scenes
here=tests/accuracy
scenes=("$ships"/{first-cut,squeezed-block,relaxing-block,ringing-bar,half-cut-equilibrium}.toml
  "$here"/{hex-shelf,pressed-pad,two-blocks,organ-tet,loaded-strip}.toml
  "$here"/{sheared-cube,sagging-plate,stiff-inclusion,soft-column,released-beam}.toml
  "$here"/{slit-strip,graded-block,squeezed-cube,octree-shelf,lifted-kidney}.toml)
[ $# -gt 0 ] && scenes=("$@")
out=${OUT:-$(mktemp -d)}
exec cargo run -p scindo-study --example own_scenes -- "${BUDGET_MS:-10}" "${WITHIN_S:-180}" "$out" "${scenes[@]}"

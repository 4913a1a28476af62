#!/usr/bin/env bash
# Strict type check of the page, in a copy: check.sh FOLDER (kept between runs, so packages stay).
set -euo pipefail
web=$(cd "$(dirname "$0")" && pwd)
copy=${1:?usage: check.sh FOLDER}
mkdir -p "$copy"
rm -rf "$copy/src"
cp -r "$web"/{package.json,package-lock.json,.npmrc,tsconfig.json,build.mjs,src} "$copy/"
cd "$copy"
if ! cmp -s package-lock.json node_modules/.scindo-lock; then
  npm ci --silent --no-audit --no-fund
  cp package-lock.json node_modules/.scindo-lock
fi
SCINDO_PROTO="$web/../../../proto" npm run --silent check
echo "page: types hold"

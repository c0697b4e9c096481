#!/usr/bin/env bash
# What a web server needs of the rendered book, in one folder: publish.sh FOLDER. Pages start with underscores, so that
# GitHub must not run Jekyll on them.
set -euo pipefail
cd "$(dirname "$0")/.."
into=${1:?publish.sh FOLDER}
test -f build/html/index.html || { echo "there is no rendered book; run make html first" >&2; exit 1; }
rm -rf "$into"
cp -r build/html "$into"
if [ -f build/meshes_as_measures.pdf ]; then cp build/meshes_as_measures.pdf "$into"; fi
touch "$into/.nojekyll"
echo "publish $into"

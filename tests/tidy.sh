#!/usr/bin/env bash
# clang-tidy, as .clang-tidy has it, over the sources that changed since BASE, or over FILES. Fails
# with what it finds.
#
# BUILD  build folder with compile_commands.json (build/release)
# BASE   commit to compare with (HEAD~1); uncommitted changes count
# FILES  sources to look at instead
set -euo pipefail
cd "$(dirname "$0")/.."
build=${BUILD:-build/release}

command -v clang-tidy > /dev/null || {
  echo "tidy: clang-tidy is missing: apt-get install clang-tidy" >&2
  exit 2
}
[ -f "$build/compile_commands.json" ] || {
  echo "tidy: $build/compile_commands.json is missing: run 'make programs'" >&2
  exit 2
}
if [ -n "${FILES:-}" ]; then
  files=$FILES
else
  files=$(git diff --name-only --diff-filter=d "${BASE:-HEAD~1}" -- '*.cpp')
fi
# Only what the compiler was told of: no fuzz target, no test that was left out.
known=()
for file in $files; do
  if grep -q "\"file\": \".*/$file\"" "$build/compile_commands.json"; then
    known+=("$file")
  elif [ -n "${FILES:-}" ]; then
    echo "tidy: $file is no source that $build compiles" >&2
    exit 2
  fi
done
[ ${#known[@]} -gt 0 ] || { echo "tidy: no changed sources"; exit 0; }

# GCC's precompiled headers are nothing to clang.
database=$(mktemp -d)
trap 'rm -rf "$database"' EXIT
sed -E 's/ -Winvalid-pch//; s/ -fpch-preprocess//; s/ -include [^ ]*cmake_pch\.hxx//' \
  "$build/compile_commands.json" > "$database/compile_commands.json"
# How many warnings there are in headers that are not ours is of no interest.
if printf '%s\0' "${known[@]}" | xargs -0 -n 1 -P "$(nproc)" \
    clang-tidy -p "$database" --quiet --warnings-as-errors='*' 2> "$database/noise"; then
  echo "tidy: ${#known[@]} sources, no findings"
else
  grep -vE '^[0-9]+ warnings? (generated|treated as errors?)' "$database/noise" >&2 || true
  exit 1
fi

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

# Debian's default, clang 14, does not know C++20's aggregates in parentheses nor libstdc++'s ranges.
clang_tidy=clang-tidy-16
command -v "$clang_tidy" > /dev/null || {
  echo "tidy: $clang_tidy is missing: apt-get install $clang_tidy" >&2
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
# GCC's precompiled headers are nothing to clang, and sources that are compiled in batches get entries of
# their own.
database=$(mktemp -d)
trap 'rm -rf "$database"' EXIT
/usr/bin/python3 - "$build/compile_commands.json" > "$database/compile_commands.json" << 'end'
import json, re, sys
entries = []
for entry in json.load(open(sys.argv[1])):
    command = re.sub(r" -Winvalid-pch| -fpch-preprocess| -include \S*cmake_pch\.hxx", "", entry["command"])
    sources = [entry["file"]]
    if "/Unity/unity_" in entry["file"]:
        sources = re.findall(r'#include "(.*)"', open(entry["file"]).read())
    entries += [{**entry, "file": source, "command": command.replace(entry["file"], source)} for source in sources]
json.dump(entries, sys.stdout, indent=0)
end
# Only what the compiler was told of: no fuzz target, no test that was left out.
known=()
for file in $files; do
  if grep -q "\"file\": \".*/$file\"" "$database/compile_commands.json"; then
    known+=("$file")
  elif [ -n "${FILES:-}" ]; then
    echo "tidy: $file is no source that $build compiles" >&2
    exit 2
  fi
done
[ ${#known[@]} -gt 0 ] || { echo "tidy: no changed sources"; exit 0; }

# How many warnings there are in headers that are not ours is of no interest.
if printf '%s\0' "${known[@]}" | xargs -0 -n 1 -P "$(nproc)" \
    "$clang_tidy" -p "$database" --quiet --warnings-as-errors='*' 2> "$database/noise"; then
  echo "tidy: ${#known[@]} sources, no findings"
else
  grep -vE '^[0-9]+ warnings? (generated|treated as errors?)' "$database/noise" >&2 || true
  exit 1
fi

#!/bin/bash
# Fuzzes every target, or those that are named:
#   tests/fuzz/fuzz.sh SECONDS [TARGET...]
# JOBS of them run at a time (1). Inputs start from the targets' own seeds and from what is kept in
# corpus/ and crashes/; new ones stay in build/fuzz/found/<target>/. Exit code 1 when a target
# crashed, leaked, ran out of memory, or took more than INPUT_SECONDS (10) for one input: more is
# needed only where the machine is busy with other things.
set -u -o pipefail
seconds=${1:?usage: tests/fuzz/fuzz.sh SECONDS [TARGET...]}; shift
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
programs=$root/build/fuzz/fuzz
found=$root/build/fuzz/found
export seconds here programs found

if ! echo 'extern "C" int LLVMFuzzerTestOneInput(const char*, long) { return 0; }' |
    clang++ -fsanitize=fuzzer,address -fopenmp -x c++ - -o /dev/null 2>/dev/null; then
  echo "Fuzzing needs clang with libFuzzer and OpenMP:" \
    "apt-get install clang libclang-rt-14-dev libfuzzer-14-dev libomp-dev" >&2
  exit 2
fi
if [ -z "${STILLMAP_FUZZ_BUILT:-}" ]; then
  (cd "$root" && cmake --preset fuzz >/dev/null && cmake --build --preset fuzz --target fuzz_targets -j "$(nproc)") || exit 2
fi
targets=("$@")
if [ ${#targets[@]} = 0 ]; then
  mapfile -t targets < <(sed -n 's/^fuzz_target(\([a-z_]*\).*/\1/p' "$here/CMakeLists.txt")
fi

run_target() {
  local target=$1 folder=$found/$1
  mkdir -p "$folder/inputs" "$folder/crashes" "$here/corpus/$target" "$here/crashes/$target"
  rm -f "$folder/exit_code" "$folder/row"
  "$programs/fuzz_$target" --seeds "$folder/inputs" || return
  # Fast DDS 2.9 deletes one of its own classes by another one's size.
  ASAN_OPTIONS=new_delete_type_mismatch=0 UBSAN_OPTIONS=print_stacktrace=1 \
    nice -n 5 "$programs/fuzz_$target" -max_total_time="$seconds" -timeout="${INPUT_SECONDS:-10}" -rss_limit_mb=3072 \
    -print_final_stats=1 -artifact_prefix="$folder/crashes/" \
    "$folder/inputs" "$here/corpus/$target" "$here/crashes/$target" >"$folder/log" 2>&1 &
  local pid=$!
  wait "$pid"
  echo $? >"$folder/exit_code"
  rm -rf "/dev/shm/stillmap_fuzz_$pid"
  report "$target"
}

report() {
  local log=$found/$1/log
  local runs time rate edges crashes=0
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  rate=$(sed -n 's/^stat::average_exec_per_sec: *//p' "$log")
  time=$(sed -n 's/^Done [0-9]* runs in \([0-9]*\) second.*/\1/p' "$log")
  edges=$(grep -o 'cov: [0-9]*' "$log" | tail -1 | cut -d' ' -f2)
  [ "$(cat "$found/$1/exit_code")" = 0 ] || crashes=1
  printf '%-16s %10s %8s %8s %8s %8s\n' "$1" "${runs:--}" "${time:-early}" "${rate:--}" \
    "${edges:--}" "$crashes" | tee "$found/$1/row"
}
export -f run_target report

printf '%-16s %10s %8s %8s %8s %8s\n' target runs seconds runs/s edges crashes
printf '%s\n' "${targets[@]}" | xargs -P "${JOBS:-1}" -I{} bash -c 'run_target {}'
for target in "${targets[@]}"; do
  if [ "$(cat "$found/$target/exit_code" 2>/dev/null)" != 0 ]; then
    echo "$target: see $found/$target/log and the input in $found/$target/crashes" >&2
    failed=1
  fi
done
exit ${failed:-0}

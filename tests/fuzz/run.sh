#!/bin/bash
# Fuzz targets, one after another: tests/fuzz/run.sh SECONDS [TARGET ...]. New inputs go to out/fuzz, faults to out/fuzz/faults.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=$1
shift

# Budgets of every target [s, MiB, bytes]. An input of 8 kB that takes more is a fault.
limits=(-max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=256 -max_len=8192 -print_final_stats=1)
# Memory of a target without a sanitizer, which sees no single allocation [KiB].
address_space=8388608

skip() {
  echo "fuzz-bytes is skipped: $1"
  exit 0
}
export PATH="$PWD/target/fuzz/tools/bin:$PATH"
cargo +nightly --version >/dev/null 2>&1 ||
  skip "there is no nightly compiler; run 'rustup toolchain install nightly'"
cargo fuzz --version >/dev/null 2>&1 ||
  cargo install cargo-fuzz --version '=0.13.2' --locked --quiet --root target/fuzz/tools ||
  skip "cargo-fuzz is missing and cannot be installed; run 'cargo install cargo-fuzz'"

run() {
  local folder=$1 sanitizer=$2 target=$3 dictionary=()
  echo "== $target, $seconds s"
  mkdir -p "out/fuzz/$target" out/fuzz/faults
  if [ -f "tests/fuzz/dictionaries/$target.dict" ]; then
    dictionary=(-dict="tests/fuzz/dictionaries/$target.dict")
  fi
  cargo +nightly fuzz run --fuzz-dir "$folder" --target-dir "target/fuzz/$sanitizer" --sanitizer "$sanitizer" "$target" \
    "out/fuzz/$target" "tests/fuzz/corpus/$target" -- \
    -artifact_prefix="out/fuzz/faults/$target-" "${dictionary[@]}" "${limits[@]}"
}

wanted=" $* "
for target in $(cargo +nightly fuzz list --fuzz-dir tests/fuzz); do
  if [ $# = 0 ] || [[ $wanted == *" $target "* ]]; then run tests/fuzz address "$target"; fi
done
# Without a sanitizer, and with little optimization, the stages take minutes to build and not an hour.
export CARGO_PROFILE_RELEASE_OPT_LEVEL=1
ulimit -v "$address_space"
for target in $(cargo +nightly fuzz list --fuzz-dir tests/fuzz/simulation); do
  if [ $# = 0 ] || [[ $wanted == *" $target "* ]]; then run tests/fuzz/simulation none "$target"; fi
done

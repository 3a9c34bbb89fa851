#!/usr/bin/env bash
# Looks for wrong uses of memory and of threads that tests alone do not show.
#
#   tests/nightly/memory.sh miri|asan|tsan|loom [TOOLCHAIN]
#
# Prints `skipped: NAME: REASON` and ends with 0 where the tools of a check cannot be had.
set -euo pipefail
cd "$(dirname "$0")/../.."
check=$1
toolchain=${2:-nightly}
host=$(rustc -vV | sed -n 's/^host: //p')
# flags of a check compile everything anew
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target}/$check

skip() {
  echo "skipped: $check: $1"
  exit 0
}

# Installs the toolchain with components where it is not there.
need() {
  command -v rustup >/dev/null || skip "it needs rustup, which installs nightly Rust"
  [[ $host == *-linux-gnu ]] || skip "tried on Linux alone, and this is $host"
  rustup run "$toolchain" rustc --version >/dev/null 2>&1 ||
    rustup toolchain install "$toolchain" --profile minimal >/dev/null 2>&1 ||
    skip "rustup cannot install the toolchain $toolchain"
  for component in "$@"; do
    rustup component add "$component" --toolchain "$toolchain" >/dev/null 2>&1 ||
      skip "rustup has no component $component of $toolchain; name a day that has it: make $check TOOLCHAIN=nightly-2026-05-19"
  done
}

run() {
  echo "cargo $*"
  cargo "+$toolchain" "$@"
}

case $check in
miri)
  need miri rust-src
  # without files, clocks and threads of the system there is nothing to try
  export MIRIFLAGS=-Zmiri-disable-isolation
  # modules without shared memory, signals and sockets, which Miri has not
  run miri test -p sim-protocol --lib -- wire:: waiting::turn memory::problem transport:: journal::
  run miri test -p sim-client-c --lib
  # registers of eight worlds: Miri has no comparisons of AVX-512, which AddressSanitizer sees
  export RUSTFLAGS=-Ctarget-feature=+avx2,+fma,+bmi1,+bmi2
  [[ $host == x86_64-* ]] || unset RUSTFLAGS
  # what runs hundreds of programs or ten thousands of angles takes hours in an interpreter
  run miri test -p sim-physics --test lane -- --skip sincos --skip kept --skip random_programs --skip f32_agrees \
    --skip order_of_worlds --skip takes_every_path
  ;;
asan)
  need
  export RUSTFLAGS=-Zsanitizer=address
  run test --target "$host" -p sim-protocol -p sim-client-c -p sim-system -p sim-physics --lib
  run test --target "$host" -p sim-physics --test lane
  ;;
tsan)
  # the standard library is watched, too: its locks look like races else
  need rust-src
  export RUSTFLAGS=-Zsanitizer=thread
  # one test measures rates, which a watched daemon does not reach
  run test -Zbuild-std --target "$host" -p sim-protocol -p sim-client-c --lib -- --skip observers_see_fewer_frames
  ;;
loom)
  RUSTFLAGS="--cfg loom" cargo test --release -p sim-loom --lib
  ;;
*)
  echo "there is no check $check; give miri, asan, tsan or loom" >&2
  exit 2
  ;;
esac

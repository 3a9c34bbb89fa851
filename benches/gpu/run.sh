#!/bin/sh
# Worlds on a GPU: checks, then numbers (main.rs says which).
#
#   benches/gpu/run.sh [--adapter NAME] [--worlds 1024,4096] [--scenes grasp] [--seconds 2] [--csv FILE] [--no-import]
#
# In a checkout it builds the bench. Elsewhere it takes the binary `gpu_bench` that lies beside it, so these two files are all
# that another machine needs, besides a Vulkan driver. Drivers keep what they have compiled: here in a folder that goes at the end.
# "Cold" builds run in separate processes with empty cache folders (build_time.rs).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
if [ -x "$here/gpu_bench" ]; then
  bench="$here/gpu_bench"
else
  cd "$here/../.."
  cargo build --release --quiet --workspace --example gpu_bench
  bench="${CARGO_TARGET_DIR:-target}/release/examples/gpu_bench"
  set -- --fact "commit: $(git describe --always --dirty '--exclude=*')" "$@"
fi
kept=$(mktemp -d)
trap 'rm -rf "$kept"' EXIT
export MESA_SHADER_CACHE_DIR="$kept" __GL_SHADER_DISK_CACHE_PATH="$kept" XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$kept}"
"$bench" --fact "date: $(date -u +%F)" "$@"

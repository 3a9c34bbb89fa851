#!/usr/bin/env bash
# Runs tests of 64-bit ARM under qemu: those of Rust, then those of the Python client with an emulated Python.
#
#   tests/aarch64/run.sh PYTHON       (`make test-aarch64`, which sets the linker and the emulator)
set -euo pipefail
cd "$(dirname "$0")/../.."
python=$1
target=aarch64-unknown-linux-gnu
folder=out/aarch64
built=${CARGO_TARGET_DIR:-target}/$target/release

cargo nextest --version >/dev/null || { echo "install cargo-nextest: https://nexte.st"; exit 1; }
TIGHTLOOP_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu" cargo nextest run --release --target $target --workspace --config-file tests/aarch64/nextest.toml \
  -E "$(grep -v '^#' tests/aarch64/selection.txt)" --no-fail-fast
# with the features of the tests, or all is built again
cargo build --release --target $target --workspace --lib --tests --quiet

[ -x $folder/python ] || tests/aarch64/python.sh $folder "$python"
rm -rf $folder/site/tightloop
cp -r py-client/python/tightloop $folder/site/
cp "$built/lib_core.so" $folder/site/tightloop/_core.abi3.so

# lessons recorded on this machine have the same bits on the other
rm -rf $folder/lessons
PYTHONPATH=examples "$python" tests/aarch64/record_lessons.py $folder/lessons
for lesson in $folder/lessons/*.tlrec; do
  PYTHONPATH=$folder/site $folder/python -m tightloop replay "$lesson"
done
mapfile -t files < <(grep '\.py$' tests/aarch64/python.txt)
mapfile -t options < <(grep '^--' tests/aarch64/python.txt)
# an emulated test keeps one core busy, so two halves of the files run at once
halves=()
for half in 0 1; do
  selected=()
  for ((k = half; k < ${#files[@]}; k += 2)); do selected+=("${files[k]}"); done
  PYTHONPATH=$folder/site $folder/python -m pytest -c py-client/pyproject.toml --rootdir . -p no:cacheprovider -q \
    "${options[@]}" "${selected[@]}" > $folder/python-$half.log 2>&1 &
  halves+=($!)
done
failed=0
for half in 0 1; do
  wait "${halves[half]}" || failed=1
  cat $folder/python-$half.log
done
exit $failed

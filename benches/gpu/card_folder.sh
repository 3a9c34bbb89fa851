#!/bin/sh
# Puts what a machine with a GPU and no network needs into a folder below 60 MB: card.sh says how to use it.
#
#   benches/gpu/card_folder.sh FOLDER SCENES [WHEEL...]
#
# It takes the built gpu_bench, the wheel of .venv, the scenes of card_scenes.py, and other wheels: such as those of mujoco and
# mujoco-mjx for the machine's Python, and of nvidia-ml-py for the energy of both. CARD_MOST is another limit [MB]: the wheel of
# warp-lang, which MuJoCo-Warp needs, is larger.
set -eu
folder=$1 scenes=$2
shift 2
cd "$(dirname "$0")/../.."
most=${CARD_MOST:-60} # [MB]
rm -rf "$folder"
mkdir -p "$folder/wheels" "$folder/lib" "$folder/benches/gpu" "$folder/benches/physics" "$folder/examples" "$folder/tests/python/mujoco"
strip -o "$folder/gpu_bench" "${CARGO_TARGET_DIR:-target}/release/examples/gpu_bench"
gzip -6 "$folder/gpu_bench"
cp .venv/wheels/*.whl "$@" "$folder/wheels"
# libraries of this computer, for machines that have a driver without them: the loader, and what NVIDIA's driver is not found without
for name in libvulkan.so.1 libEGL.so.1 libGL.so.1 libGLX.so.0 libGLdispatch.so.0 libOpenGL.so.0; do
  found=$(ldconfig -p | awk -v name="$name" '$1 == name {print $NF; exit}')
  [ -z "$found" ] || cp -L "$found" "$folder/lib/$name"
done
cp benches/gpu/card.sh "$folder"
cp -r "$scenes" "$folder/scenes"
cp benches/gpu/card_report.py benches/gpu/gpu_peers.py benches/gpu/tensors.py benches/gpu/published.csv "$folder/benches/gpu"
# what gpu_peers.py imports, and the robots of these
cp -r benches/record.py benches/robots "$folder/benches"
cp benches/physics/contacts.py benches/physics/legged.py "$folder/benches/physics"
cp -rL examples/franka_grasp.py examples/franka_lesson.py examples/assets "$folder/examples"
mkdir -p "$folder/examples/learning"
cp examples/learning/__init__.py examples/learning/places.py "$folder/examples/learning"
cp tests/python/mujoco/mujoco_model.py "$folder/tests/python/mujoco"
cp -r tests/data "$folder/tests"
git describe --always --dirty '--exclude=*' >"$folder/commit"
size=$(du -sm --apparent-size "$folder" | cut -f1)
if [ "$size" -ge "$most" ]; then
  echo "$folder has $size MB, and must stay below $most: give fewer wheels" >&2
  exit 1
fi
echo "$folder: $size MB; copy it to the machine and run $(basename "$folder")/card.sh there"

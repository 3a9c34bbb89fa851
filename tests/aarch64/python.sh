#!/usr/bin/env bash
# Makes a folder with Debian's Python for 64-bit ARM, the packages that tests import, and `python`, which runs it under
# qemu. Needs no root, and changes nothing outside the folder.
#
#   tests/aarch64/python.sh FOLDER PYTHON
set -euo pipefail
folder=$(realpath -m "$1")
python=$2
packages=(python3.11 python3.11-minimal libpython3.11-minimal libpython3.11-stdlib libc6 libgcc-s1 libstdc++6 libexpat1
  zlib1g libssl3 libffi8 libbz2-1.0 liblzma5 libsqlite3-0 libuuid1 libcrypt1)
apt=(apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o Dir::State::lists="$folder/lists"
  -o Dir::Cache="$folder/cache" -o Dir::State::status="$folder/status" -o APT::Sandbox::User=root)

mkdir -p "$folder"/{lists/partial,cache/archives/partial,debs,root,site}
: > "$folder/status"
"${apt[@]}" update
(cd "$folder/debs" && "${apt[@]}" download "${packages[@]}")
for package in "$folder"/debs/*.deb; do
  dpkg-deb -x "$package" "$folder/root"
done
"$python" -m pip install --quiet --disable-pip-version-check --upgrade --target "$folder/site" --python-version 3.11 \
  --platform manylinux_2_28_aarch64 --platform manylinux2014_aarch64 --platform manylinux_2_17_aarch64 --only-binary :all: numpy 'gymnasium>=1.1,<2' pytest \
  'mujoco==3.17.*' safetensors

cat > "$folder/python" <<END
#!/bin/sh
MUJOCO_GL=disable exec qemu-aarch64 -L "$folder/root" "$folder/root/usr/bin/python3.11" "\$@"
END
chmod +x "$folder/python"
# a child is started with the emulator, too
cat > "$folder/site/sitecustomize.py" <<END
import sys

sys.executable = "$folder/python"
END
"$folder/python" -c 'import platform; assert platform.machine() == "aarch64"'

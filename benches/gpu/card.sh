#!/bin/bash
# Checks and measures everything that needs a GPU, on a machine without a network. `make card` makes the folder for it.
#
#   ./card.sh          the stages that are not finished; ends some seconds after CARD_SECONDS at the latest
#   ./card.sh 1 2      these stages
#
# Exit codes: 0 = all is there, 1 = something failed or its stage ran out of time (the report names it), 3 = call again.
# What this machine cannot measure, such as tensors without torch, is no failure: its result has the reason.
#
# stage                                              at most [s]   result
#   1  results beside MuJoCo; bits for 1 to 65,536 worlds;   420   log.txt
#      the bits of the CPU
#   2  speed of all scenes, commands to arrays; energy       900   speed.csv
#   3  threads per world, cuts of kernels                    240   splits.csv
#   4  tensors without copies                                 90   tensors.csv
#   5  time stamps of the kernels, what the profiler sees    240   profile.txt
#   6  MuJoCo-Warp and MJX, or published figures             900   peers.csv or published.csv
#   7  the CPU of this machine                               300   speed.csv
#
# Scenes are five of the bench's own, and MuJoCo's models in the folder scenes.
#
# A stage consists of pieces, a command each. pieces.csv has a line for each piece: state, key, seconds, date, clocks after it.
# A call skips the pieces that are done, so it goes on where another was cut off or killed. stamp.txt has the commit, the
# adapter and the driver of the results; a call with others is refused.
#
#   CARD_RESULTS   folder of the results (default: results beside this file)
#   CARD_COPY      another folder, which gets a copy of the results after each piece
#   CARD_SECONDS   limit of a call (default 540)
#   CARD_QUICK=1   small numbers, to try the script on a software driver
#   CARD_ADAPTER   index or part of the name of the adapter
set -u
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
results=${CARD_RESULTS:-$here/results}
began=$SECONDS
call_limit=${CARD_SECONDS:-540}
limits=(0 420 900 240 90 240 900 300)
mkdir -p "$results" "$here/cache" || exit 1
log=$results/log.txt pieces=$results/pieces.csv
commit=$(cat "$here/commit")
touch "$log" "$pieces"

# what the folder has of MuJoCo's models, by their names
models=""
for name in g1_flat humanoid panda shadow_hand go1 ant three_humanoids; do
  [ -e "$here/scenes/$name.toml" ] && models="$models $name"
done
scenes="torque_free target grasp standing quadruped$models"
counts="4096 8192 16384 1024 65536" peer_counts="8192 4096 16384" checks=4096,65536 timed_worlds=4096,16384 seconds=1 tensors=()
split_scenes="grasp standing" split_worlds="4096"
bits_scenes="torque_free grasp standing"
[ -e "$here/scenes/g1_flat.toml" ] && bits_scenes="$bits_scenes g1_flat"
ways=("" "--cpu-bits" "--world-threads 1" "--world-threads 4" "--world-threads 16" "--kernel-size 12000" "--kernel-size 3000"
  "--dispatch-price 5000" "--dispatch-price 500" "--world-threads 32" "--kernel-size 24000")
if [ -n "${CARD_QUICK:-}" ]; then
  models=""
  [ -e "$here/scenes/tiny.toml" ] && models=" tiny"
  scenes="torque_free$models" counts="64 1024" peer_counts="64" checks=16,64 timed_worlds=64 seconds=0.05 tensors=(--worlds 64 --frames 20)
  split_scenes="torque_free" split_worlds="64" ways=("" "--cpu-bits" "--kernel-size 3000") bits_scenes="torque_free"
fi

say() { printf '%s\n' "$@" | tee -a "$log"; }

publish() {
  if [ -n "${CARD_COPY:-}" ] && ! [ "$CARD_COPY" -ef "$results" ]; then
    mkdir -p "$CARD_COPY" && cp "$results"/* "$CARD_COPY"/
  fi
}

# `timeout` has a process group of its own, so a signal to this script's group does not reach it. The kernel sends it TERM
# when this script ends, and it passes that on to its group.
guard=()
setpriv --pdeathsig TERM true 2>/dev/null && guard=(setpriv --pdeathsig TERM)

# seconds that this call has left
call_left() { echo $((call_limit - SECONDS + began)); }

failed=0 waiting=0
time_is_up() {
  [ "$(call_left)" -gt 2 ] || waiting=1
  [ "$waiting" = 1 ]
}

# limited SECONDS COMMAND...: a command that is no piece, within these seconds and what this call has left
limited() {
  local most=$1 left
  shift
  left=$(call_left)
  [ "$left" -lt "$most" ] && most=$left
  "${guard[@]}" timeout -k 2 "$((most > 0 ? most : 1))" "$@"
}

smi() { timeout --foreground -k 2 10 nvidia-smi "$@"; }

# clocks [MHz], power [W] and temperature [°C] of an NVIDIA card, while it is still warm from what it just did
clocks() {
  if command -v nvidia-smi >/dev/null; then
    smi --query-gpu=clocks.sm,clocks.mem,power.draw,temperature.gpu --format=csv,noheader | head -n 1 | tr -d ' ' | tr ',' ' '
  else
    echo unknown
  fi
}

# seconds that the pieces of a stage have taken so far, in all calls
spent() { awk -F, -v stage="$1/" 'index($2, stage) == 1 {sum += $3} END {print int(sum)}' "$pieces"; }

is_done() { grep -q "^done,$1," "$pieces"; }

# piece KEY COMMAND...: runs a command unless it is done, within what is left for its stage and for this call
piece() {
  local key=$1 stage=${1%%/*} left call_left from rc state
  shift
  is_done "$key" && return 0
  time_is_up && return 0
  left=$((limits[stage] - $(spent "$stage")))
  call_left=$(call_left)
  if [ "$left" -le 0 ]; then
    say "$key: left out, its stage has had its ${limits[stage]} s"
    failed=1
    return 0
  fi
  [ "$call_left" -lt "$left" ] && left=$call_left
  say "" "== $key: $(date -u '+%F %T'), at most $left s"
  from=$SECONDS
  "${guard[@]}" timeout -k 5 "$left" "$@" </dev/null 2>&1 | tee -a "$log"
  rc=${PIPESTATUS[0]}
  case $rc in
    0) state=done ;;
    124 | 137) state=cut ;;
    *) state=failed ;;
  esac
  # at least one second, so that pieces which are cut at once come to an end
  printf '%s,%s,%s,%s,%s\n' "$state" "$key" "$((SECONDS - from > 0 ? SECONDS - from : 1))" \
    "$(date -u '+%FT%TZ')" "$(clocks)" >>"$pieces"
  if [ "$state" = cut ] && [ "$left" -eq "$call_left" ]; then
    waiting=1
  elif [ "$state" != done ]; then
    say "$key: $state (exit code $rc)"
    failed=1
  fi
  publish
}

# The libraries of the folder that the machine lacks; NVIDIA's driver where containers mount it.
drivers() {
  local name lacking=$here/cache/lib
  mkdir -p "$lacking"
  for name in "$here"/lib/*; do
    ldconfig -p 2>/dev/null | grep -q "${name##*/} " || ln -sf "$name" "$lacking"
  done
  export LD_LIBRARY_PATH="$lacking${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
  local mounted=/usr/local/nvidia/share/vulkan/icd.d/nvidia_icd.json
  if [ -z "${VK_DRIVER_FILES:-}" ] && [ -e "$mounted" ] && ! ls /etc/vulkan/icd.d/nvidia* /usr/share/vulkan/icd.d/nvidia* >/dev/null 2>&1; then
    export VK_DRIVER_FILES=$mounted
  fi
  export MESA_SHADER_CACHE_DIR="$here/cache" __GL_SHADER_DISK_CACHE_PATH="$here/cache" __GL_SHADER_DISK_CACHE_SKIP_CLEANUP=1
  export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$here/cache}" XDG_CACHE_HOME="$here/cache"
}

# The adapter and the driver that answer, as the head of the results has them. One world on the CPU is the cheapest run.
probe() {
  limited 60 "$here/gpu_bench" ${CARD_ADAPTER:+--adapter "$CARD_ADAPTER"} \
    --checks skip --brief --side cpu --scenes torque_free --worlds 1 --seconds 0.001 2>&1
}

# Refuses to put results beside those of another commit, adapter or driver: a file has one head for all its rows.
check_stamp() {
  local stamp=$results/stamp.txt printed rc found
  printed=$(probe)
  rc=$?
  if { [ "$rc" = 124 ] || [ "$rc" = 137 ]; } && time_is_up; then return; fi
  found=$(printf 'commit: %s\n' "$commit"; grep -E '^(adapter|driver): ' <<<"$printed")
  driver=$(sed -n 's/^driver: //p' <<<"$found")
  [ -n "$driver" ] || say "no adapter answers: $(head -n 1 <<<"$printed")"
  if [ -e "$stamp" ] && [ "$(cat "$stamp")" != "$found" ]; then
    printf '%s\n' "$results has results of" "$(cat "$stamp")" "and this call would add those of" "$found" \
      "set CARD_RESULTS to another folder, or delete this one" >&2
    exit 1
  fi
  # without an adapter nothing is measured, and the next call may find one
  [ -z "$driver" ] || printf '%s\n' "$found" >"$stamp"
}

# Python with the packages of the folder; `python` stays empty where there is none.
packages() {
  python=$(command -v python3 || true)
  [ -n "$python" ] || { say "python3 is not installed: the stages 4 and 6 and the report need it"; return; }
  export PYTHONPATH="$here/site${PYTHONPATH:+:$PYTHONPATH}" PYTHONDONTWRITEBYTECODE=1
  [ -d "$here/site" ] && return
  time_is_up && return
  rm -rf "$here/site.part"
  limited 120 "$python" -m pip install --quiet --no-index --no-deps --no-compile --no-cache-dir --target "$here/site.part" "$here"/wheels/*.whl \
    >>"$log" 2>&1 && mv "$here/site.part" "$here/site" || time_is_up || say "the wheels could not be installed; log.txt says why"
}

# a scene as the bench has it: its name, or its file
as_file() { [ -e "$here/scenes/$1.toml" ] && echo "$here/scenes/$1.toml" || echo "$1"; }

bench() { "$here/gpu_bench" ${CARD_ADAPTER:+--adapter "$CARD_ADAPTER"} --cache "$here/cache/programs" \
  --fact "date: $(date -u +%F)" --fact "commit: $commit" --fact "clocks before: $(clocks)" "$@"; }
export -f bench clocks smi
export here commit

# gpu KEY ARGUMENTS...: a piece of the bench
gpu() {
  local key=$1
  shift
  piece "$key" bash -c 'bench "$@"' bench "$@"
}

python_piece() {
  if [ -z "$python" ]; then
    say "$1: left out, python3 is not installed"
    failed=1
  else
    local key=$1
    shift
    piece "$key" "$python" "$@"
  fi
}

stage_1() {
  for scene in $scenes; do gpu "1/$scene" --checks only --scenes "$(as_file "$scene")" --check-worlds "$checks"; done
  for scene in $bits_scenes; do gpu "1/bits-$scene" --checks only --cpu-bits --scenes "$(as_file "$scene")" --check-worlds 64; done
}

measured() { gpu "$1" --checks skip --brief --side "$2" --scenes "$(as_file "$3")" --worlds "$4" --seconds "$seconds" --append "${@:5}"; }

stage_2() {
  for worlds in $counts; do
    for scene in $scenes; do measured "2/$scene-$worlds" gpu "$scene" "$worlds" --csv "$results/speed.csv" --power "$seconds"; done
  done
}

stage_3() {
  local way
  for worlds in $split_worlds; do
    for way in "${ways[@]}"; do
      for scene in $split_scenes; do
        # shellcheck disable=SC2086  (an option and its value)
        measured "3/$scene-$worlds$(printf %s "$way" | tr -d ' ')" gpu "$scene" "$worlds" --csv "$results/splits.csv" $way
      done
    done
  done
}

stage_4() {
  is_done 4/tensors || python_piece 4/tensors "$here/benches/gpu/tensors.py" --if-possible --csv "$results/tensors.csv" \
    ${CARD_ADAPTER:+--adapter "$CARD_ADAPTER"} --fact "commit: $commit" --fact "driver: $driver" \
    --fact "clocks before: $(clocks)" "${tensors[@]}"
}

# Time stamps of the kernels. Vulkan's are invisible to ncu, which knows CUDA's: what it says is kept, and clocks and load beside it.
profiled() {
  local scene=${split_scenes%% *} worlds=${split_worlds%% *}
  local run=(--checks skip --brief --side gpu --scenes "$scene" --worlds "$worlds" --seconds "$seconds")
  local rc=0
  echo "commit: $commit, date: $(date -u +%F)"
  bench --checks skip --kernel-times "$here/cache/kernel_times.csv" --scenes "$files" --worlds "$timed_worlds" || rc=$?
  echo "$scene with $worlds worlds:"
  if command -v nvidia-smi >/dev/null; then
    smi
    timeout --foreground 40 nvidia-smi dmon -s pucm -c 20 &
    bench "${run[@]}" || rc=$?
    wait
  else
    echo "nvidia-smi is not installed: no clocks, no load"
  fi
  if command -v ncu >/dev/null; then
    ncu --clock-control none --target-processes all --launch-count 40 --section SpeedOfLight --section Occupancy \
      "$here/gpu_bench" ${CARD_ADAPTER:+--adapter "$CARD_ADAPTER"} --cache "$here/cache/programs" "${run[@]}" 2>&1
    echo "ncu counts kernels of CUDA; if it names none above, the counters of Vulkan's kernels are not to be had with it"
  else
    echo "ncu is not installed: no counters"
  fi
  return "$rc"
}
export -f profiled
stage_5() {
  local scene files=""
  for scene in $scenes; do files="$files${files:+,}$(as_file "$scene")"; done
  export files timed_worlds split_scenes split_worlds seconds
  piece 5/profile bash -c 'profiled >"$0" 2>&1' "$results/profile.txt"
}

stage_6() {
  local file=$results/peers.csv
  time_is_up && return
  if [ -n "$python" ] && limited 60 "$python" "$here/benches/gpu/gpu_peers.py" --installed >>"$log" 2>&1; then
    for worlds in $peer_counts; do
      for scene in $scenes; do
        [ "$scene" = standing ] && continue
        python_piece "6/$scene-$worlds" "$here/benches/gpu/gpu_peers.py" --scenes "$(as_file "$scene")" --worlds "$worlds" --seconds "$seconds" \
          --fact "commit: $commit" --csv "$file" --append
      done
    done
  fi
  time_is_up && return
  if grep -qv -e '^#' -e '^scene,' "$file" 2>/dev/null; then
    rm -f "$results/published.csv"
  else
    say "6: neither MuJoCo-Warp nor MJX is measured here (log.txt says why): published.csv has published figures"
    cp "$here/benches/gpu/published.csv" "$results"
    publish
  fi
}

stage_7() {
  for worlds in $counts; do
    for scene in $scenes; do measured "7/$scene-$worlds" cpu "$scene" "$worlds" --csv "$results/speed.csv"; done
  done
}

drivers
if ! [ -x "$here/gpu_bench" ]; then
  gzip -dc "$here/gpu_bench.gz" >"$here/gpu_bench.part" && chmod +x "$here/gpu_bench.part" && mv "$here/gpu_bench.part" "$here/gpu_bench" || exit 1
fi
driver=""
check_stamp
packages
say "" "card.sh, commit $commit, $(date -u '+%F %T') UTC, $(uname -m), $(nproc) cores"
if command -v nvidia-smi >/dev/null; then
  smi --query-gpu=name,driver_version,memory.total,clocks.max.sm,clocks.max.mem --format=csv 2>&1 | tee -a "$log"
else
  say "nvidia-smi is not installed: clocks, power and load are unknown"
fi
for stage in "${@:-1 2 3 4 5 6 7}"; do
  for number in $stage; do
    time_is_up && break 2
    case $number in [1-7]) "stage_$number" ;; *) say "stage $number: unknown; give numbers from 1 to 7"; exit 1 ;; esac
  done
done
[ -n "$python" ] && "${guard[@]}" timeout -k 2 10 "$python" "$here/benches/gpu/card_report.py" "$results" 2>&1 | tee -a "$log"
publish
if [ "$waiting" = 1 ]; then
  say "time is up: call card.sh again"
  exit 3
fi
exit "$failed"

#!/usr/bin/env bash
# Runs make targets one after the other, also after one that fails. Ends with a list of them: what became of each, and its
# seconds. Output of each lies in out/nightly.
#
#   tests/nightly/parts.sh TARGET...
set -uo pipefail
cd "$(dirname "$0")/../.."
mkdir -p out/nightly
rows=() failed=0

for part in "$@"; do
  echo "make $part"
  log=out/nightly/$part.log
  began=$SECONDS
  make --no-print-directory "$part" 2>&1 | tee "$log"
  status=${PIPESTATUS[0]}
  # a target skips itself, or a part of itself
  reasons=$(sed -n 's/^skipped: //p' "$log" | paste -sd ';')
  if [ "$status" != 0 ]; then
    outcome=failed failed=1
  elif [[ $reasons == "$part: "* ]]; then
    outcome=skipped
  else
    outcome=passed
  fi
  rows+=("$(printf '%-8s %-14s %6d s  %s' "$outcome" "$part" $((SECONDS - began)) "$reasons")")
done

printf '\n%s\n' "what became of each part:"
printf '%s\n' "${rows[@]}"
exit "$failed"

#!/usr/bin/env bash
# scripts/learn-surface-network on the states of one shape: it learns, twice the same, goes on from a network, and names bad
# input.  tests/scripts/learn_surface_network_test.sh BIN
# Status 77: PyTorch is not installed.
set -uo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
bin=$(realpath "$1")
learn=$root/scripts/learn-surface-network
/usr/bin/python3 -c 'import numpy, torch' 2>/dev/null ||
  { echo "SKIPPED: PyTorch is missing; run  scripts/setup learning"; exit 77; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 1

fail() {
  echo "FAILED: $1" >&2
  exit 1
}

# refuses WORDS COMMAND...: ends with an error that says WORDS, without a traceback.
refuses() {
  local words=$1 said
  shift
  if said=$("$@" 2>&1); then fail "no error: $*"; fi
  [[ $said == *"$words"* && $said != *Traceback* ]] || fail "$*: expected \"$words\", but: $said"
}

# loss OUT: of the last line that a run printed.
loss() { tail -n 1 "$1" | sed 's/.*loss //'; }

"$bin/vantage-experiment" shapes --first 6 --count 1 --out shapes >shapes.out || fail "shapes"
"$bin/vantage-experiment" states --objects shapes/shape-6.ply --out states >states.out || fail "states"
[[ -s states/shape-6-seed1.states ]] || fail "no states"

# One thread: those of OpenMP wait for each other by turning, dear beside other tests.
"$learn" states --out one.bin --steps 12 --batch 2 --threads 1 >one.out || fail "learning: $(cat one.out)"
"$learn" states --out two.bin --steps 12 --batch 2 --threads 1 >two.out || fail "learning again"
cmp one.bin two.bin || fail "the same steps gave another network"
(($(stat -c %s one.bin) == $(stat -c %s "$root/offboard/lookahead/surface_network.bin"))) || fail "of another size"

# The program's network knows more than one that has hardly begun; it is not changed by a rate of nearly nothing.
"$learn" states --out on.bin --steps 12 --batch 2 --threads 1 --rate 1e-9 \
  --begin "$root/offboard/lookahead/surface_network.bin" >on.out ||
  fail "going on: $(cat on.out)"
awk -v new="$(loss one.out)" -v learned="$(loss on.out)" 'BEGIN { exit !(learned < 0.8 * new) }' ||
  fail "loss of the program's network $(loss on.out), of a new one $(loss one.out)"
"$learn" --answer on.bin >answer.h || fail "no answer"
grep -q kSurfaceNetworkAnswer answer.h || fail "the answer is no header"

refuses "holds no .states files" "$learn" shapes --out x.bin
refuses "are needed" "$learn" states
refuses "at least 1" "$learn" states --out x.bin --threads 0
refuses "is not a network" "$learn" --answer shapes/shape-6.ply
refuses "can't be read" "$learn" --answer nowhere.bin
mkdir -p cut foreign
head -c 1000000 states/shape-6-seed1.states >cut/shape-6-seed1.states
refuses "ends early" "$learn" cut --out x.bin
cp shapes/shape-6.ply foreign/a.states
refuses "is not a file of vantage-experiment states" "$learn" foreign --out x.bin
[[ ! -e x.bin ]] || fail "bad input left a network"
echo "learned: loss $(loss one.out); the program's network: $(loss on.out)"

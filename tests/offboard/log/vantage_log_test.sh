#!/usr/bin/env bash
# vantage-log from outside: statuses, one line a fault, nothing left behind.  vantage_log_test.sh BIN RELEASED
set -uo pipefail
log_tool=$1/vantage-log released=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 1

fail() {
  echo "FAILED: $1" >&2
  cat stdout stderr >&2
  exit 1
}

# expect STATUS TEXT ARGUMENT...: the status; TEXT on stdout for 0 and 1, alone on stderr for 2.
expect() {
  local want=$1 text=$2 got=0
  shift 2
  "$log_tool" "$@" >stdout 2>stderr || got=$?
  ((got == want)) || fail "status $got instead of $want: $*"
  if ((want == 2)); then
    grep -qF -- "$text" stderr || fail "no \"$text\" on stderr: $*"
    (($(wc -l <stderr) == 1)) || fail "more than one line on stderr: $*"
    [[ ! -s stdout ]] || fail "something on stdout: $*"
  else
    grep -qF -- "$text" stdout || fail "no \"$text\" on stdout: $*"
    [[ ! -s stderr ]] || fail "something on stderr: $*"
  fi
}

mkdir session
cp "$released/0.1.0.lcm" session/log.lcm
expect 0 '13 events in 1 part, 5169 bytes' info session
expect 0 'VANTAGE_HEARTBEAT_1       heartbeat_t           older' info session/log.lcm
expect 0 '1 depth maps and 1 in chunks, 0 events of unknown channels; no fault' check session

expect 0 'cut.lcm: 4 of 13 events' cut --from 0.4 --to 00:00:00.7 session cut.lcm
expect 2 'cut.lcm: exists; give another name, or --overwrite' cut session cut.lcm
expect 0 'cut.lcm: 13 of 13 events' cut session cut.lcm --overwrite
cmp cut.lcm session/log.lcm || fail "a cut of everything is not the same log"
expect 2 'is the log that is cut' cut session session/log.lcm --overwrite
expect 2 '--from soon: expected seconds' cut --from soon session other.lcm
expect 2 'no event is within these times' cut --from 99 session other.lcm
[[ ! -e other.lcm ]] || fail "left a log behind"

head -c 5000 session/log.lcm >torn.lcm
expect 1 'torn.lcm: at byte 4929: the log ends within an event (71 bytes of it)' check torn.lcm
expect 0 'the last 71 bytes are no whole event' info torn.lcm
expect 0 'a torn end of 71 bytes cut off' cut torn.lcm mended.lcm
printf x | dd of=mended.lcm bs=1 seek=5 conv=notrunc status=none
expect 0 'no fault' check mended.lcm
printf x | dd of=mended.lcm bs=1 seek=492 conv=notrunc status=none
expect 1 'mended.lcm: at byte 492: the log is damaged' check mended.lcm

expect 0 't.txt: 2 poses' export session --tum t.txt --png png --ply c.ply --mcap m.mcap
expect 0 't.txt: 2 poses' export session --tum t.txt --tum-from states --overwrite
expect 2 'm.mcap: exists' export session --mcap m.mcap
expect 2 'png: is not empty' export session --png png
expect 2 'export: say what' export session
expect 2 'none/t.txt: can'\''t be written' export session --tum none/t.txt
expect 2 'none.lcm: no such file' info none.lcm
mkdir empty
expect 2 'empty: holds no session' check empty
printf 'this is text, and long enough to be taken for a header' >text.lcm
expect 2 'text.lcm: at byte 0: not an LCM log' check text.lcm
expect 2 'text.lcm: at byte 0: not an LCM log' export text.lcm --mcap text.mcap
if compgen -G '*.tmp-*' >/dev/null || [[ -e text.mcap ]]; then fail "left something behind: $(ls)"; fi
echo "passed"

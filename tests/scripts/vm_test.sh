#!/usr/bin/env bash
# Tests of scripts/vm-test: tests/scripts/vm_test.sh NAME. The test `devices` runs inside the machine, the others outside.
# A test is a function test_NAME; it fails by `fail`. Status 125: no machine can be had here.
set -uo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
vm=$root/scripts/vm-test
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

fail() { echo "FAILED: $1" >&2; exit 1; }

# run STATUS ARGUMENT...: vm-test, with its output in $scratch/out and $scratch/err.
run() {
  local want=$1 got=0
  shift
  "$vm" "$@" >"$scratch/out" 2>"$scratch/err" || got=$?
  if ((got == 125 && want != 125)); then
    echo "SKIPPED: no virtual machine can be had here: $(<"$scratch/err")"
    exit 125
  fi
  ((got == want)) || fail "status $got instead of $want: vm-test $*: $(<"$scratch/err")"
}

# expect_text FILE TEXT: that and no more.
expect_text() {
  [[ $(<"$scratch/$1") == "$2" ]] || fail "$1 is \"$(<"$scratch/$1")\" instead of \"$2\""
}

# await COMMAND...: until the command succeeds; long enough for a busy machine.
await() {
  local deadline=$((SECONDS + 60))
  until "$@"; do
    ((SECONDS < deadline)) || return 1
    sleep 0.02
  done
}

# --- Inside, with two cameras: all is there; CAN and CAN FD frames pass; a bad line delays; a camera shows what is written.
test_devices() {
  local node
  for node in /sys/class/net/vcan0 /sys/class/net/vcan1 /dev/video0 /dev/video1 /dev/video2 /dev/video3; do
    [[ -e $node ]] || fail "$node is missing"
  done
  [[ ! -e /dev/video4 ]] || fail "there is a third camera"
  can_frames_pass
  line_delays
  local pixels=$((640 * 480))
  camera_shows_what_is_written 2 GREY $pixels
  camera_shows_what_is_written 2 YUYV $((2 * pixels))
  camera_shows_what_is_written 0 NV12 $((3 * pixels / 2))
}

can_frames_pass() {
  timeout 60 candump -n 2 -L vcan0 >"$scratch/can" &
  local witness=$!
  await grep -q '^ *vcan0 ' /proc/net/can/rcvlist_all || fail "candump does not listen"
  cansend vcan0 123#DEADBEEF
  cansend vcan0 1A5##5001122334455667788990011
  wait "$witness" || fail "candump did not see two frames"
  grep -q 'vcan0 123#DEADBEEF$' "$scratch/can" || fail "the CAN frame differs: $(<"$scratch/can")"
  grep -q 'vcan0 1A5##5001122334455667788990011$' "$scratch/can" || fail "the CAN FD frame differs: $(<"$scratch/can")"
}

# Two hosts with 40 ms each way: an answer takes 80 ms or, on a busy machine, longer.
line_delays() {
  ip netns add far
  ip link add near type veth peer name far netns far
  ip address add 10.0.0.1/24 dev near
  ip -n far address add 10.0.0.2/24 dev far
  ip link set near up
  ip -n far link set far up
  tc qdisc add dev near root netem delay 40ms
  ip netns exec far tc qdisc add dev far root netem delay 40ms
  # shellcheck disable=SC2016  # Perl's own
  ip netns exec far perl -MIO::Socket::INET -e '
    my $socket = IO::Socket::INET->new(Proto => "udp", LocalPort => 7, LocalAddr => "10.0.0.2") or die $!;
    while (defined(my $peer = $socket->recv(my $text, 100))) { $socket->send($text, 0, $peer) }' &
  local echo=$! took_ms
  await ip netns exec far grep -q 0200000A:0007 /proc/net/udp || fail "the far host does not listen"
  # The first answer also waits for the address resolution.
  took_ms=$(perl -MIO::Socket::INET -MTime::HiRes=time -e '
    my $socket = IO::Socket::INET->new(Proto => "udp", PeerAddr => "10.0.0.2", PeerPort => 7) or die $!;
    my $start;
    for (1, 2) { $start = time; $socket->send("?"); $socket->recv(my $text, 100) }
    printf "%d", 1000 * (time - $start) + 0.5') || fail "no answer over veth"
  kill "$echo"
  ((took_ms >= 80)) || fail "an answer took $took_ms ms, less than the line's 80"
}

# camera_shows_what_is_written NODE FORMAT BYTES: of 20 frames captured while eight different ones of so many bytes are
# written round and round, each is one of the eight to the byte, but for the first ones; and all eight come.
camera_shows_what_is_written() {
  local capture=$1 output=$(($1 + 1)) format=width=640,height=480,pixelformat=$2 size=$3
  # The rows of a frame differ, since 997 is prime; the frames differ by their first byte.
  perl -e 'my $size = $ARGV[0];
    for my $k (1 .. 8) { my $row = join "", map { chr(($_ * $_ + 31 * $k) % 251) } 0 .. 996;
      print substr($row x ($size / 997 + 1), 0, $size) }' "$size" >"$scratch/written"
  v4l2-ctl -d "$capture" --set-fmt-video "$format" >"$scratch/format" || fail "no $2: $(<"$scratch/format")"
  v4l2-ctl -d "$output" --set-fmt-video-out "$format" >"$scratch/format" || fail "no $2: $(<"$scratch/format")"
  v4l2-ctl -d "$output" --stream-out-mmap --stream-from="$scratch/written" --stream-loop >"$scratch/writer" 2>&1 &
  local writer=$!
  timeout 60 v4l2-ctl -d "$capture" --stream-mmap --stream-skip=5 --stream-count=20 --stream-to="$scratch/captured" \
    >"$scratch/reader" 2>&1 || fail "no frames of $2: $(<"$scratch/reader")"
  kill "$writer"
  wait "$writer"
  digests() { split -b "$size" --filter=sha256sum "$scratch/$1"; }
  digests written | sort -u >"$scratch/known"
  (($(wc -l <"$scratch/known") == 8)) || fail "the written frames of $2 are not eight"
  digests captured >"$scratch/seen"
  (($(wc -l <"$scratch/seen") == 20)) || fail "not twenty frames of $2 came"
  (($(grep -cvxFf "$scratch/known" "$scratch/seen") == 0)) || fail "a frame of $2 came that nobody has written"
  (($(sort -u "$scratch/seen" | wc -l) == 8)) || fail "not all eight frames of $2 came"
}

# --- The command's status, output, arguments, folder and environment pass through.
test_pass_through() {
  # shellcheck disable=SC2016  # for the shell inside
  VANTAGE_WORD=$'two\nlines' run 7 -w "$scratch" -- bash -c 'echo "out $1 $2 $PWD"; echo "err $VANTAGE_WORD $VANTAGE_VM" >&2; exit 7' \
    x 'a  b' $'c\n"d"'
  expect_text out "out a  b c"$'\n'"\"d\" $PWD"
  expect_text err "err two"$'\n'"lines uml"
  # shellcheck disable=SC2016
  run 137 -- bash -c 'kill -KILL $$'
  run 127 -- no-such-command
  grep -q 'no-such-command' "$scratch/err" || fail "the missing command is not named"
  run 126 -- bash -c 'echo before; sleep 0.2; exec busybox poweroff -f'
  expect_text out before
}

# --- What is written below -w is on the host afterwards; what is written elsewhere is not.
test_folders() {
  mkdir "$scratch/shared folder" "$scratch/other" "$scratch/unshared"
  echo host >"$scratch/unshared/file"
  # shellcheck disable=SC2016
  run 0 -w "$scratch/shared folder" -w "$scratch/other" -- bash -c '
    set -e
    cd "$1"
    head -c 3000000 /dev/zero | tr "\0" x >"shared folder/file"
    mkdir -p "shared folder/new"; chmod 700 "shared folder/new"; ln -s file "shared folder/link"
    echo 2 >other/file
    [[ $(<unshared/file) == host ]]; echo guest >unshared/file; [[ $(<unshared/file) == guest ]]' x "$scratch"
  [[ $(tr -d x <"$scratch/shared folder/file" | wc -c) == 0 ]] || fail "the file's bytes differ"
  (($(wc -c <"$scratch/shared folder/file") == 3000000)) || fail "the file is not whole"
  [[ -d "$scratch/shared folder/new" && -L "$scratch/shared folder/link" ]] || fail "folder or link did not come back"
  [[ $(<"$scratch/other/file") == 2 ]] || fail "the second folder's file did not come back"
  [[ $(<"$scratch/unshared/file") == host ]] || fail "a file outside the shared folders was changed"
}

# machines: the processes of machines that this test has started; they bear its mark.
machines() { grep -lsaF "$scratch" /proc/[0-9]*/environ 2>/dev/null | xargs -r -n 1 dirname | while read -r process; do
  [[ $(readlink "$process/exe") == *linux-uml-* ]] && echo "$process"; done; }
no_machine() { [[ -z $(machines) ]]; }
a_machine() { [[ -n $(machines) ]]; }

# --- A command that takes too long ends with 124, and nothing of the machine stays.
test_time_out() {
  export VANTAGE_MARK=$scratch
  run 124 -t 4 -- sleep 1000
  grep -q 'time-out after 4 s' "$scratch/err" || fail "does not say that it took too long"
  await no_machine || fail "the machine still runs: $(machines)"
}

# --- Whether vm-test is ended or killed, its machine goes with it.
test_killed() {
  export VANTAGE_MARK=$scratch
  local signal pid
  for signal in TERM KILL; do
    run 0 -- true
    "$vm" -- bash -c 'echo started; sleep 1000' >"$scratch/out" 2>"$scratch/err" &
    pid=$!
    await grep -qs started "$scratch/out" || fail "does not start"
    a_machine || fail "the test does not see the machine"
    kill "-$signal" "$pid"
    await no_machine || fail "the machine outlives vm-test killed by $signal: $(machines)"
    wait "$pid" 2>/dev/null
  done
}

# --- In simulated time an hour passes while the host waits seconds, and a periodic timer keeps its period.
test_simulated_time() {
  # shellcheck disable=SC2016
  run 0 -s -t 300 -- perl -MTime::HiRes=time,sleep -e '
    my $start = time; sleep 3600; printf "%.0f\n", time - $start;
    my $worst = 0; $start = time;
    for my $i (1 .. 500) { my $wait = $start + 0.01 * $i - time; sleep $wait; my $late = time - $start - 0.01 * $i;
      $worst = $late if $late > $worst }
    printf "%s\n", $worst < 0.002 ? "on time" : sprintf("%.6f s late", $worst)'
  expect_text out $'3600\non time'
}

# --- Wrong use is named in one line, with status 125, and nothing is started.
test_wrong_use() {
  expect_refusal() {
    local text=$1
    shift
    run 125 "$@"
    grep -qF -- "$text" "$scratch/err" || fail "no \"$text\" on stderr: $*"
    (($(wc -l <"$scratch/err") == 1)) || fail "more than one line on stderr: $*"
  }
  expect_refusal "no command"
  expect_refusal "unknown option -x" -x true
  expect_refusal "-t needs a value" -t
  expect_refusal "-t takes a number from 1 to 1000000, not '0'" -t 0 true
  expect_refusal "-f takes a number from 11 to 60, not '100'" -f 100 true
  expect_refusal "-n takes a number from 1 to 8, not 'two'" -n two true
  expect_refusal "-e takes uml or tcg, not 'kvm'" -e kvm true
  expect_refusal "simulated time" -e tcg -s true
  expect_refusal "-w $scratch/none: no such folder" -w "$scratch/none" true
  expect_refusal "name a folder" -w / true
  mkdir "$scratch/a,b"
  expect_refusal "comma" -w "$scratch/a,b" true
  VANTAGE_VM_CACHE=/proc/none expect_refusal "set VANTAGE_VM_CACHE" true
  "$vm" --help | grep -q -- '-w DIR' || fail "--help does not help"
}

declare -F "test_${1:-}" >/dev/null || fail "there is no test ${1:-}"
"test_$1"
echo "passed: $1"

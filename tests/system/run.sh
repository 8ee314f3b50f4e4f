#!/usr/bin/env bash
# One test over several programs: tests/system/run.sh BIN NAME. Runs in a network of its own (scripts/private-network).
# A test is a function test_NAME; it fails by `fail`, and finds a scratch folder in $scratch.
set -uo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
bin=$1 name=$2
export VANTAGE_BIN=$bin
teapot=$root/models/teapot.ply
rig=$root/calib/rigs/simulated_stereo.yaml
scratch=$(mktemp -d)
pids=()
# shellcheck disable=SC2317  # called by the trap
cleanup() {
  for pid in "${pids[@]}"; do kill -KILL "$pid" 2>/dev/null; done
  rm -rf "$scratch"
}
trap cleanup EXIT

fail() {
  echo "FAILED: $1" >&2
  for log in "$scratch"/*.log; do [[ -f $log ]] && { echo "--- $log" >&2; tail -n 20 "$log" >&2; }; done
  exit 1
}

# expect_status STATUS COMMAND...: the command's output goes to $scratch/out.log.
expect_status() {
  local want=$1 got=0
  shift
  "$@" >"$scratch/out.log" 2>&1 || got=$?
  ((got == want)) || fail "exit status $got instead of $want: $*"
}

# expect_error TEXT COMMAND...: status 2, one line on stderr that holds TEXT, nothing on stdout.
expect_error() {
  local text=$1
  shift
  local got=0
  "$@" >"$scratch/stdout.log" 2>"$scratch/stderr.log" || got=$?
  ((got == 2)) || fail "exit status $got instead of 2: $*"
  grep -qF -- "$text" "$scratch/stderr.log" || fail "no \"$text\" on stderr: $*"
  (($(wc -l <"$scratch/stderr.log") == 1)) || fail "more than one line on stderr: $*"
  [[ ! -s $scratch/stdout.log ]] || fail "something on stdout: $*"
}

# await_socket PATH PID: until the process serves there, 20 s at most.
await_socket() {
  for _ in $(seq 400); do
    [[ -S $1 ]] && return
    kill -0 "$2" 2>/dev/null || break
    sleep 0.05
  done
  fail "nobody serves $1"
}

start_sim() {
  "$bin/vantage-sim" --object "$teapot" --socket "$scratch/sim" --write-truth "$scratch/truth.ply" \
    >"$scratch/sim.log" 2>&1 &
  sim=$!
  pids+=("$sim")
  await_socket "$scratch/sim" "$sim"
}

# Starts simulator and robot; sets $sim and $onboard.
start_robot() {
  start_sim
  "$bin/vantage-onboard" --camera "sim:$scratch/sim" --rig "$rig" "$@" >"$scratch/onboard.log" 2>&1 &
  onboard=$!
  pids+=("$onboard")
}

start_planner() {
  "$bin/vantage-offboard" --session "$scratch/session" --overwrite --truth "$scratch/truth.ply" "$@" \
    >"$scratch/offboard.log" 2>&1 &
  offboard=$!
  pids+=("$offboard")
}

# expect_end PID SECONDS STATUS NAME: the process ends in time, with that status.
expect_end() {
  local pid=$1 deadline=$((SECONDS + $2 + 1)) want=$3 got=0
  while kill -0 "$pid" 2>/dev/null; do
    ((SECONDS < deadline)) || fail "$4 still runs after $2 s"
    sleep 0.1
  done
  wait "$pid" || got=$?
  ((got == want)) || fail "$4 ended with status $got instead of $want"
}

await_view() {
  for _ in $(seq 600); do
    grep -q "^view $1 of" "$scratch/offboard.log" && return
    sleep 0.1
  done
  fail "view $1 does not come"
}

# reconstruct VIEWS LEAST ARGUMENT...: the teapot, at least so much of it, and the same decisions again from the log.
reconstruct() {
  local views=$1 least=$2 last
  shift 2
  expect_status 0 "$root/scripts/run-simulation" "$scratch" "$teapot" 1 --most-views "$views" "$@"
  last=$(tail -n 1 "$scratch/out.log")
  [[ $last =~ ^coverage\ (0\.[0-9]{3})\ after\ $views\ views$ ]] || fail "last line is \"$last\""
  awk -v c="${BASH_REMATCH[1]}" -v least="$least" 'BEGIN { exit !(c >= least) }' || fail "$last: less than $least"
  for file in log.lcm steps.csv scores.csv map.ot mesh.ply cloud.ply view.html config.yaml; do
    [[ -s $scratch/$file ]] || fail "$file is missing"
  done
  expect_status 0 "$bin/vantage-offboard" --replay "$scratch/log.lcm" --speed 0 --session "$scratch/again"
  for file in steps.csv scores.csv map.ot mesh.ply cloud.ply view.html; do
    cmp "$scratch/$file" "$scratch/again/$file" || fail "the replay's $file differs"
  done
  [[ $(tail -n 1 "$scratch/out.log") == "$last" ]] || fail "the replay ends with another line"
  echo "$last"
}

# --- The whole way, as the paper plans and several views ahead.
test_reconstruction() { reconstruct 12 0.85; }
test_reconstruction_ahead() { reconstruct 6 0.88 --method view_set; }

# --- The same with one camera on a carrier that is off by 2 mm and 0.2 degrees: tracking, and depth from small motions.
test_reconstruction_mono() {
  expect_status 0 "$root/scripts/run-simulation" "$scratch" "$teapot" 1 --mono --most-views 12
  local last
  last=$(tail -n 1 "$scratch/out.log")
  [[ $last =~ ^coverage\ (0\.[0-9]{3})\ after\ 12\ views$ ]] || fail "last line is \"$last\""
  awk -v c="${BASH_REMATCH[1]}" 'BEGIN { exit !(c >= 0.80) }' || fail "$last: less than 0.80"
  expect_status 0 "$bin/vantage-offboard" --replay "$scratch/log.lcm" --speed 0 --session "$scratch/again"
  cmp "$scratch/map.ot" "$scratch/again/map.ot" || fail "the replay's map differs"
  echo "$last"
}

# --- A camera carried by hand, from a folder of images: every depth map arrives, and both programs end well.
test_by_hand() {
  expect_status 0 "$bin/vantage-sim-record" --out "$scratch/walk" --path circle --object "$teapot" --object-size 0.6 \
    --frames 100
  sed -e 's/752/640/; s/480/480/; s/448 px/460 px/g; s/375.5/319.5/' "$root/calib/rigs/simulated_mono.yaml" \
    >"$scratch/camera.yaml"
  "$bin/vantage-onboard" --camera "images:$scratch/walk/rgb" --rig "$scratch/camera.yaml" --distance 1.48 --down 28 \
    --height 0.2 >"$scratch/onboard.log" 2>&1 &
  onboard=$!
  pids+=("$onboard")
  expect_status 0 "$bin/vantage-offboard" --no-planning --session "$scratch/session"
  grep -q 'the robot has finished: .*all 100 images were shown' "$scratch/out.log" || fail "does not say why it ended"
  expect_end "$onboard" 5 0 vantage-onboard
  [[ $(tail -n 1 "$scratch/out.log") =~ ^([0-9]+)\ occupied\ voxels\ after\ ([0-9]+)\ depth\ maps$ ]] ||
    fail "last line is \"$(tail -n 1 "$scratch/out.log")\""
  ((BASH_REMATCH[1] > 5000 && BASH_REMATCH[2] >= 5)) || fail "$(tail -n 1 "$scratch/out.log"): too few"
  expect_error 'a pair can'"'"'t be carried by hand' "$bin/vantage-onboard" --camera "images:$scratch/walk/rgb" --rig "$rig"
}

# --- A file of views instead of the paper's.
test_views_from_file() {
  printf '0.6 0 0.15 -0.5 -0.5 0.5 0.5\n0 0.6 0.15 0 -0.7071068 0.7071068 0\n' >"$scratch/views.txt"
  start_robot
  expect_status 0 "$bin/vantage-offboard" --session "$scratch/session" --views "$scratch/views.txt" --gain occlusion_aware
  grep -q 'every candidate has been visited' "$scratch/out.log" || fail "did not visit both views"
  expect_end "$onboard" 5 0 vantage-onboard
  expect_end "$sim" 5 0 vantage-sim
}

# --- Whoever is killed, the others end within 5 s and say why.
test_kill_sim() {
  start_robot
  start_planner
  await_view 1
  kill -KILL "$sim"
  expect_end "$onboard" 5 3 vantage-onboard
  expect_end "$offboard" 5 3 vantage-offboard
  grep -q 'the simulator has gone' "$scratch/onboard.log" || fail "onboard does not say why"
  grep -q 'the robot has ended: the simulator has gone' "$scratch/offboard.log" || fail "offboard does not say why"
  [[ -s $scratch/session/map.ot ]] || fail "the planner lost its map"
}

test_kill_onboard() {
  start_robot
  start_planner
  await_view 1
  kill -KILL "$onboard"
  expect_end "$sim" 5 3 vantage-sim
  expect_end "$offboard" 5 3 vantage-offboard
  grep -q 'client' "$scratch/sim.log" || fail "the simulator does not say why"
  grep -q 'the robot has gone' "$scratch/offboard.log" || fail "offboard does not say why"
}

test_kill_offboard() {
  start_robot
  start_planner
  await_view 1
  kill -KILL "$offboard"
  expect_end "$onboard" 5 3 vantage-onboard
  expect_end "$sim" 5 0 vantage-sim
  grep -q 'the planner has gone' "$scratch/onboard.log" || fail "onboard does not say why"
}

# --- A robot told to hold goes on with the next planner.
test_hold_without_planner() {
  start_robot --on-lost-planner hold
  start_planner
  await_view 1
  kill -KILL "$offboard"
  sleep 4
  kill -0 "$onboard" || fail "the robot's program has ended"
  grep -q 'stands still' "$scratch/onboard.log" || fail "the robot does not say that it holds"
  : >"$scratch/offboard.log"
  start_planner --most-views 2
  expect_end "$offboard" 40 0 vantage-offboard
  expect_end "$onboard" 5 0 vantage-onboard
}

# --- Only who has the key is heard.
test_keys() {
  "$bin/vantage-keygen" "$scratch/key" >"$scratch/out.log" || fail "no key"
  "$bin/vantage-keygen" "$scratch/other" >>"$scratch/out.log" || fail "no second key"
  expect_error "key: exists already" "$bin/vantage-keygen" "$scratch/key"
  chmod 644 "$scratch/other"
  expect_error "chmod 600 $scratch/other" "$bin/vantage-offboard" --session "$scratch/session" --key "$scratch/other"
  chmod 600 "$scratch/other"
  expect_error "no key is given" "$bin/vantage-offboard" --session "$scratch/session" \
    --lcm 'udpm://239.255.76.67:7667?ttl=1'
  [[ ! -e $scratch/session ]] || fail "left a session behind"
  start_robot --key "$scratch/key" --key "$scratch/other"
  # Without a key, and with one that is not the robot's, nobody hears the robot nor is heard.
  "$bin/vantage-keygen" "$scratch/foreign" >>"$scratch/out.log" || fail "no third key"
  expect_status 3 "$bin/vantage-command" stop
  expect_status 3 "$bin/vantage-command" stop --key "$scratch/foreign"
  if grep -q 'stands still' "$scratch/onboard.log"; then fail "a stranger stopped the robot"; fi
  local lines
  lines=$(grep -c 'with a wrong seal so far' "$scratch/onboard.log") || fail "the robot does not say that strangers spoke"
  ((lines <= 8)) || fail "the robot says more than once a second that strangers spoke"
  # The robot seals with its first key; whoever has one of its others is obeyed but hears nothing.
  expect_status 0 "$bin/vantage-command" stop --key "$scratch/key"
  grep -q 'stop: the camera stands still' "$scratch/onboard.log" || fail "the robot does not stop"
  # A planner does not get it moving; a resume does.
  start_planner --key "$scratch/key" --most-views 2
  sleep 3
  if grep -q '^view 1' "$scratch/offboard.log"; then fail "a stopped robot moved"; fi
  expect_status 0 "$bin/vantage-command" resume --key "$scratch/key"
  expect_end "$offboard" 40 0 vantage-offboard
  expect_end "$onboard" 5 0 vantage-onboard
}

# --- Somebody leads a paused robot; the planner's goal comes after the resume.
test_lead() {
  printf '0 0.6 0 0.4 -0.5 -0.5 0.5 0.5\n1 0.6 0.2 0.5 -0.5 -0.5 0.5 0.5\n' >"$scratch/way.txt"
  start_robot
  for _ in $(seq 200); do grep -q 'waiting for goals' "$scratch/onboard.log" && break; sleep 0.1; done
  expect_status 0 "$bin/vantage-command" pause
  expect_status 0 "$bin/vantage-command" follow "$scratch/way.txt"
  grep -q '^there' "$scratch/out.log" || fail "does not say that it is there"
  grep -q 'trajectory of 2 waypoints' "$scratch/onboard.log" || fail "the robot does not say that it follows"
  expect_status 0 "$bin/vantage-command" stop
  expect_status 3 "$bin/vantage-command" follow "$scratch/way.txt"
  expect_status 0 "$bin/vantage-command" resume
  start_planner --most-views 1
  expect_end "$offboard" 40 0 vantage-offboard
  expect_end "$onboard" 5 0 vantage-onboard
  expect_error "none.txt" "$bin/vantage-command" follow "$scratch/none.txt"
  expect_error "a FILE belongs to follow" "$bin/vantage-command" pause "$scratch/way.txt"
}

# --- A planner that was killed goes on with its session.
test_resume() {
  start_robot --on-lost-planner hold
  start_planner --most-views 4
  await_view 2
  kill -KILL "$offboard"
  [[ ! -e $scratch/session/map.ot ]] || fail "the killed planner wrote its map"
  expect_status 0 "$bin/vantage-offboard" --resume "$scratch/session"
  grep -q '^resumed after [23] views' "$scratch/out.log" || fail "does not say that it resumed"
  [[ $(tail -n 1 "$scratch/out.log") == *"after 4 views" ]] || fail "did not come to four views"
  expect_end "$onboard" 5 0 vantage-onboard
  expect_status 0 "$bin/vantage-offboard" --replay "$scratch/session/log.lcm" --speed 0 --session "$scratch/again"
  for file in steps.csv scores.csv map.ot; do
    cmp "$scratch/session/$file" "$scratch/again/$file" || fail "the replay's $file differs"
  done
  expect_error "no session to resume" "$bin/vantage-offboard" --resume "$scratch/none"
}

# --- A network without a multicast route.
test_no_route() {
  ip route del 224.0.0.0/4 dev lo
  expect_error "ip route add 224.0.0.0/4 dev lo" "$bin/vantage-offboard" --session "$scratch/session"
  [[ ! -e $scratch/session ]] || fail "left a session behind"
}

# --- Bad input is named, with status 2, and nothing is left behind.
test_bad_input() {
  local offboard=("$bin/vantage-offboard" --session "$scratch/session")
  printf 'not a log, but long enough for a header' >"$scratch/text.lcm"
  expect_error "none.lcm: no such file" "${offboard[@]}" --replay "$scratch/none.lcm"
  expect_error "text.lcm: at byte 0: not an LCM log" "${offboard[@]}" --replay "$scratch/text.lcm"
  expect_error "none.ply: no such file" "${offboard[@]}" --truth "$scratch/none.ply"
  expect_error "none.yaml: no such file" "${offboard[@]}" --config "$scratch/none.yaml"
  printf 'config_version: 1\nregion:\n  resolution: 1\n' >"$scratch/bare.yaml"
  expect_error "bare.yaml:3: region.resolution: expected a number with its unit" "${offboard[@]}" \
    --config "$scratch/bare.yaml"
  printf '0 0 0 0 0 0 1\n1 nan 0 0 0 0 1\n' >"$scratch/views.txt"
  expect_error "views.txt:2: the number nan is not finite" "${offboard[@]}" --views "$scratch/views.txt"
  expect_error "there is no view 99" "${offboard[@]}" --first-view 99
  expect_error "rear_side_entropy" "${offboard[@]}" --gain best
  expect_error "view_set" "${offboard[@]}" --method best
  expect_error "of --method utility alone" "${offboard[@]}" --method view_set --gain combined
  [[ ! -e $scratch/session ]] || fail "left a session behind"

  local mono=$root/calib/rigs/simulated_mono.yaml
  expect_error "sim:SOCKET" "$bin/vantage-onboard" --camera /dev/video0 --rig "$mono"
  expect_error "/dev/no-such-video" "$bin/vantage-onboard" --camera v4l2:/dev/no-such-video --rig "$mono"
  expect_error "carried by hand" "$bin/vantage-onboard" --camera v4l2:/dev/no-such-video --rig "$rig"
  expect_error "$scratch/none.yaml" "$bin/vantage-onboard" --camera sim:x --rig "$scratch/none.yaml"
  expect_error "--rig FILE is needed" "$bin/vantage-onboard" --camera sim:x
  expect_error "--check needs --camera, --can or both" "$bin/vantage-onboard" --check
  expect_error "drives are only used with --check" "$bin/vantage-onboard" --can sim:x --rig "$rig"
  expect_error "describes no drives" "$bin/vantage-onboard" --check --can sim:x --rig "$rig"
  expect_error "nobody serves a simulated CAN bus there" "$bin/vantage-onboard" --check --can "sim:$scratch/x"
  expect_error "holds no image" "$bin/vantage-onboard" --check --camera "images:$scratch"
  expect_error "none.obj" "$bin/vantage-sim" --object "$scratch/none.obj" --socket "$scratch/s"

  sed 's/752/640/' "$rig" >"$scratch/small.yaml"
  start_sim
  expect_error "small.yaml: its camera (640 x 480" "$bin/vantage-onboard" --camera "sim:$scratch/sim" \
    --rig "$scratch/small.yaml"

  mkdir "$scratch/recording"
  expect_error "holds no recording" "$bin/vantage-import" "$scratch/recording" --out "$scratch/out.lcm"
  expect_error "none: no such folder" "$bin/vantage-import" "$scratch/none" --out "$scratch/out.lcm"
  [[ ! -e $scratch/out.lcm ]] || fail "left a log behind"
}

declare -F "test_$name" >/dev/null || fail "there is no test $name"
"test_$name"
echo "passed: $name"

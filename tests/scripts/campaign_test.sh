#!/usr/bin/env bash
# scripts/campaign.sbatch under a real Slurm of its own. One task is killed while it renders, another one's node dies between
# two of its runs; both go on, and together they make what one program makes alone, to the byte.
#   scripts/private-network unshare --pid --fork --kill-child --mount-proc tests/scripts/campaign_test.sh BIN
# Controller and node have a network of their own, and processes that end with the test. Status 77: Slurm is not installed,
# or can't run here.
set -uo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
bin=$1
export PATH=$PATH:/usr/sbin:/sbin
for command in slurmctld slurmd sbatch scontrol squeue; do
  command -v "$command" >/dev/null || { echo "SKIPPED: $command is missing; run  scripts/setup slurm"; exit 77; }
done
(($$ == 1)) || { echo "FAILED: not in a process namespace of its own" >&2; exit 1; }
if [[ $(</proc/self/setgroups) == deny ]]; then echo "SKIPPED: Slurm's programs need a real root"; exit 77; fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

fail() {
  echo "FAILED: $1" >&2
  for log in "$scratch"/*.log "$scratch"/slurm-*.out; do [[ -f $log ]] && { echo "--- $log" >&2; tail -n 15 "$log" >&2; }; done
  exit 1
}

# await WHAT COMMAND...: until the command succeeds; long enough for a busy machine.
await() {
  local deadline=$((SECONDS + 200)) what=$1
  shift
  until "$@"; do
    ((SECONDS < deadline)) || fail "waited in vain: $what"
    sleep 0.1
  done
}

# programs [TASK]: the processes of all tasks, or of one. A process namespace of our own holds none but ours.
programs() {
  { grep -lszE "^SLURM_ARRAY_TASK_ID=${1:-}" /proc/[0-9]*/environ || true; } | tr -dc '0-9\n'
}

start_slurm() {
  local host
  host=$(hostname -s)
  mkdir "$scratch/state" "$scratch/spool"
  # Slurm looks its addresses up and gets none while the machine has only 127.0.0.1. This one is for documentation.
  ip address add 192.0.2.1/32 dev lo || fail "this is not a network of its own; run it by scripts/private-network"
  cat >"$SLURM_CONF" <<CONF
ClusterName=vantage
SlurmctldHost=$host(192.0.2.1)
NodeName=$host NodeAddr=192.0.2.1 CPUs=4
PartitionName=all Nodes=ALL Default=YES
SlurmdParameters=config_overrides
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/none
CredType=cred/none
StateSaveLocation=$scratch/state
SlurmdSpoolDir=$scratch/spool
SlurmctldPidFile=$scratch/slurmctld.pid
SlurmdPidFile=$scratch/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SwitchType=switch/none
MailProg=/bin/true
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1
# A requeued task waits until the credentials of its last start are void.
AuthInfo=cred_expire=5
ReturnToService=2
CONF
  slurmctld -D >"$scratch/slurmctld.log" 2>&1 &
  start_node
}

start_node() {
  slurmd -D >>"$scratch/slurmd.log" 2>&1 &
  node=$!
  disown  # from the shell's remarks when it is killed
}

node_is_idle() { [[ $(sinfo -h -o %T 2>/dev/null) == idle ]]; }
task_is() { [[ $(squeue -h -t all -r -j "${job}_$1" -o %T 2>/dev/null) == "$2" ]]; }
files() { find "$1" -type f -name "$2" 2>/dev/null | sort; }
has_files() { (($(files "$1" "$2" | wc -l) >= $3)); }
# Names, times and contents: equal only if nobody has touched the files.
state_of() { find "$@" -type f -printf '%p %i %T@\n' | sort; }

# One box, four methods, ten views, one seed: four runs, two for each of two tasks.
box=$scratch/box.ply
cat >"$box" <<'PLY'
ply
format ascii 1.0
element vertex 8
property float x
property float y
property float z
element face 12
property list uchar int vertex_indices
end_header
-0.1 -0.1 0
0.1 -0.1 0
-0.1 0.1 0
0.1 0.1 0
-0.1 -0.1 0.24
0.1 -0.1 0.24
-0.1 0.1 0.24
0.1 0.1 0.24
3 0 1 3
3 0 3 2
3 4 5 7
3 4 7 6
3 0 1 5
3 0 5 4
3 2 3 7
3 2 7 6
3 0 2 6
3 0 6 4
3 1 3 7
3 1 7 5
PLY
experiment=(--objects "$box" --methods "random,sequential,rear_side_entropy,oracle" --views 10)

export SLURM_CONF=$scratch/slurm.conf VANTAGE_BIN=$bin
unset "${!SBATCH_@}"
cd "$scratch" || exit 1
start_slurm

# The experiment in one piece. Its rendered views spare the tasks theirs, which are most of the work, but for the last six,
# which task 2 has to make.
"$bin/vantage-experiment" run "${experiment[@]}" --out alone >alone.log 2>&1 &
alone=$!
# --- Arrays that would leave runs out are refused. Meanwhile it renders.
await "the node comes up" node_is_idle
for array in 1,3 0-1; do
  job=$(sbatch --parsable --array="$array" --output=refused-%a.log "$root/scripts/campaign.sbatch" other "${experiment[@]}")
  await "an array with gaps ends" task_is "${array:0:1}" FAILED
  grep -q 'has to be 1-N without gaps' "refused-${array:0:1}.log" || fail "the array $array is not refused"
done
[[ ! -e other ]] || fail "a refused array has written"

await "all views are rendered" has_files alone/views 'view-*.depth' 48
for task in 1 2; do
  mkdir -p "campaign/part-$task"
  cp -a alone/settings.txt alone/views "campaign/part-$task"
done
files campaign/part-2/views 'view-*.depth' | tail -n 6 | xargs rm

job=$(sbatch --parsable --array=1-2 --cpus-per-task=1 "$root/scripts/campaign.sbatch" campaign "${experiment[@]}") || fail "sbatch"

# --- A task is killed while it renders.
await "task 2 renders" has_files campaign/part-2/views 'view-*.depth' 43
kill -KILL "$(programs 2)"
! has_files campaign/part-2/views 'view-*.depth' 48 || fail "task 2 had rendered all before it was killed"
rendered=$(state_of campaign/part-2/views)
await "Slurm sees that task 2 was killed" task_is 2 FAILED
scontrol requeue "${job}_2" || fail "task 2 can't be requeued"

# --- Between two runs of task 1 its node dies, with all that runs there: Slurm's processes first, so that none of them
# reports a task's end. Slurm starts the tasks again by itself when the node is back.
await "task 1 finishes a run" has_files campaign/part-1/runs '*.csv' 1
mapfile -t node_processes < <(echo "$node"; grep -lsx slurmstepd /proc/[0-9]*/comm | tr -dc '0-9\n'; programs)
kill -KILL "${node_processes[@]}"
! has_files campaign/part-1/runs '*.csv' 2 || fail "task 1 had finished before its node died"
await "the node is gone" test ! -e "/proc/$node"
finished=$(state_of campaign/part-1/runs)
scontrol update NodeName="$(hostname -s)" State=DOWN Reason="died" || fail "the node can't be given up"
start_node

for task in 1 2; do await "task $task ends well" task_is "$task" COMPLETED; done
wait "$alone" || fail "the experiment in one piece"

# --- What was there has not been made again.
for task in 1 2; do
  restarts=$(scontrol show job "${job}_$task" | sed -n 's/.*Restarts=\([0-9]*\).*/\1/p')
  ((restarts >= 1)) || fail "task $task was not started again"
done
grep -qxF "$finished" <(state_of campaign/part-1/runs) || fail "task 1 has made a finished run again"
[[ -z $(comm -13 <(state_of campaign/part-2/views) <(echo "$rendered")) ]] || fail "task 2 has rendered a view again"

# --- Nothing lost, nothing twice, and the same to the byte but for the times.
[[ $(files campaign '*.csv' | grep -c /runs/) == 4 ]] || fail "the tasks have not made four runs"
"$bin/vantage-experiment" merge campaign/part-* --out campaign/all >merge.log 2>&1 || fail "merge"
diff <(ls alone/runs) <(ls campaign/all/runs) || fail "the campaign has made other runs"
"$bin/vantage-experiment" run "${experiment[@]}" --out campaign/all --resume >resume.log 2>&1 || fail "resume"
cmp alone/steps.csv campaign/all/steps.csv || fail "steps.csv differs"
untimed() { cut -d, -f1-8 "$1/summary.csv"; }
cmp <(untimed alone) <(untimed campaign/all) || fail "summary.csv differs"
for plot in alone/plots/*; do cmp "$plot" "campaign/all/plots/${plot##*/}" || fail "$plot differs"; done

echo "passed: campaign"

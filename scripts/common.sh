# Shared by the scripts of this folder; to be sourced. Leaves the caller in the package's root.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Another python3 before /usr/bin would hide the distribution's ROS modules.
export PATH="/usr/bin:/bin:/usr/sbin:/sbin:$PATH"
export PYTHONNOUSERSITE=1
unset PYTHONPATH PYTHONHOME || true

say() { printf '\n== %s\n' "$*" >&2; }

# Prints the comment that a script begins with, when it is asked for help or for what it does not know.
usage() { sed -n '2,/^[^#]/s/^# \{0,1\}//p' "scripts/$(basename "$0")"; }
refuse() {
  printf 'unknown argument: %s (try --help)\n' "$1" >&2
  exit 2
}

# Starts a command in the background with no input and a process group of its own, so that a signal to the
# script alone is heard at once and reaches the command with all its children. What it says goes to the file
# `output`, if a caller named one: a redirection around this would swallow the script's own last words, too.
running=
output=
start() {
  set -m
  if [ -n "$output" ]; then
    "$@" </dev/null >>"$output" 2>&1 &
  else
    "$@" </dev/null &
  fi
  running=$!
  set +m
}
finished() {
  local status=0
  wait "$running" || status=$?
  running=
  return "$status"
}

too_long() {
  local message="no end after $1 s: ${*:2}"
  if [ -n "$output" ]; then echo "$message" >>"$output"; else echo "$message" >&2; fi
}

# Runs a command so, for at most so many seconds.
limited() {
  local seconds=$1 status=0
  shift
  start timeout --kill-after=20 "$seconds" "$@"
  finished || status=$?
  [ "$status" -ne 124 ] || too_long "$seconds" "$@"
  return "$status"
}

# Ends what runs, then the script.
interrupted() {
  trap '' INT TERM HUP
  stop_telling
  if [ -n "$running" ]; then
    kill -INT -- "-$running" 2>/dev/null || true
    wait "$running" || true
  fi
  exit "$1"
}
trap 'interrupted 130' INT
trap 'interrupted 143' TERM
trap 'interrupted 129' HUP

# Says every half minute how long something has taken, until it is stopped.
teller=
tell_time() {
  local from=$SECONDS
  set -m
  while sleep 30; do echo "   $1: $((SECONDS - from)) s so far" >&2; done &
  teller=$!
  set +m
}
stop_telling() {
  [ -n "$teller" ] || return 0
  kill -- "-$teller" 2>/dev/null || true
  wait "$teller" 2>/dev/null || true
  teller=
}

# Installs those of the packages named in the given list files that are missing.
install_packages() {
  local wanted missing sudo=() log output="" status=0
  mapfile -t wanted < <(grep -hv '^#' "$@")
  # Status and name of those that dpkg knows; what is not installed is missing.
  mapfile -t missing < <(comm -23 <(printf '%s\n' "${wanted[@]}" | sort -u) \
    <(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "${wanted[@]}" 2>/dev/null |
      sed -n 's/^installed //p' | sort -u))
  [ ${#missing[@]} -eq 0 ] && return 0
  if ! command -v apt-get >/dev/null; then
    echo "no apt-get here to install: ${missing[*]}" >&2
    return 1
  fi
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "root or sudo is needed to install: ${missing[*]}" >&2; return 1; }
    sudo -n true 2>/dev/null || sudo -v || return 1
    sudo=(sudo)
  fi
  log=$(mktemp)
  say "installing ${#missing[@]} packages and what they need; the first time some minutes (log: $log)"
  output=$log
  tell_time installing
  { limited 600 "${sudo[@]}" apt-get update -o APT::Update::Error-Mode=any &&
    limited 7200 "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
      apt-get install -y --no-install-recommends "${missing[@]}"; } || status=$?
  stop_telling
  if [ "$status" -ne 0 ]; then
    tail -n 20 "$log" >&2
    echo "the packages could not be installed; the whole log: $log" >&2
    return 1
  fi
  rm -f "$log" build*/configured  # what was looked for in vain may be there now
}

# Configures a build folder, unless it was so already: what changes in the sources since, the build sees itself.
# Ninja compiles a target's sources while the libraries it links are still being made; make waits.
configure() {
  local folder=$1
  shift
  local wanted="$PWD $*" stamp=$folder/configured
  if [ -f "$folder/build.ninja" ] && [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ]; then return 0; fi
  rm -f "$stamp"
  rm -rf "$folder"/{CMakeCache.txt,CMakeFiles,Makefile}  # a folder once configured for make stays so otherwise
  # Messages for C++ and Python alone: nothing here speaks the others.
  ROS_LANG_DISABLE=genlisp:geneus:gennodejs limited 600 cmake -G Ninja -S . -B "$folder" \
    -DCMAKE_CXX_COMPILER_LAUNCHER=ccache "$@" || return
  printf '%s\n' "$wanted" >"$stamp"
}

# Builds what is asked for in a configured folder.
build_targets() {
  local folder=$1
  shift
  limited 10800 cmake --build "$folder" -j "$(nproc)" -- "$@"
}

# Configures a folder with the options before the --, builds the targets behind it, says where it goes wrong.
build_in() {
  local folder=$1 log=$1/build.log output=$1/build.log options=() status=0
  shift
  while [ "$1" != -- ]; do options+=("$1"); shift; done
  shift
  mkdir -p "$folder"
  exec 8<"$folder"  # two builds in one folder would spoil each other's files
  flock --nonblock 8 || { say "waiting for another build in $folder"; output="" limited 10800 flock 8; }
  say "building; the first time some minutes (log: $log)"
  export CCACHE_BASEDIR="$PWD" CCACHE_NOHASHDIR=1
  tell_time building
  : >"$log"
  { configure "$folder" "${options[@]}" && build_targets "$folder" "$@"; } || status=$?
  stop_telling
  exec 8<&-
  [ "$status" -eq 0 ] && return 0
  grep -nE 'error|Error' "$log" | head -n 20 >&2 || true
  tail -n 20 "$log" >&2
  return "$status"
}

# Builds into build/ and devel/ what is asked for (nothing: all but the tests). The devel space stands outside
# build/, where rosrun does not look for programs.
build() {
  rm -rf build/devel  # of a build folder that was configured before this was so
  [ -f devel/setup.bash ] || rm -f build/configured
  build_in build -DTUNNEL_PILOT_WERROR=ON -DTUNNEL_PILOT_UNITY=ON "-DCATKIN_DEVEL_PREFIX=$PWD/devel" -- "$@"
}

# Makes the built package known to roslaunch and its friends.
enter_workspace() {
  set +u
  # shellcheck disable=SC1091
  . devel/setup.bash
  set -u
  export ROS_PACKAGE_PATH="$PWD:${ROS_PACKAGE_PATH:-/usr/share}"
  export ROS_HOSTNAME="${ROS_HOSTNAME:-localhost}"
}

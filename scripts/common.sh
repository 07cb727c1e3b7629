# Shared by the scripts of this folder; to be sourced. Leaves the caller in the package's root.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Another python3 before /usr/bin would hide the distribution's ROS modules.
export PATH="/usr/bin:/bin:/usr/sbin:/sbin:$PATH"
export PYTHONNOUSERSITE=1
unset PYTHONPATH PYTHONHOME || true

say() { printf '\n== %s\n' "$*" >&2; }

# Installs those of the packages named in the given list files that are missing.
install_packages() {
  local wanted missing=() sudo=() log
  wanted=$(grep -hv '^#' "$@")
  for package in $wanted; do
    dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return 0
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "root or sudo is needed to install: ${missing[*]}" >&2; return 1; }
    sudo=(sudo)
  fi
  say "installing ${#missing[@]} packages"
  log=$(mktemp)
  if ! { "${sudo[@]}" apt-get update && "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
         apt-get install -y --no-install-recommends "${missing[@]}"; } </dev/null >"$log" 2>&1; then
    tail -n 20 "$log" >&2
    echo "the packages could not be installed; the whole log: $log" >&2
    return 1
  fi
  rm -f "$log"
}

# Configures and builds into build/ what is asked for (nothing: all but the tests).
build() {
  local log=build/build.log
  mkdir -p build
  say "building (log: $log)"
  export CCACHE_BASEDIR="$PWD" CCACHE_NOHASHDIR=1
  if ! { cmake -S . -B build -DTUNNEL_PILOT_WERROR=ON -DCMAKE_CXX_COMPILER_LAUNCHER=ccache &&
         cmake --build build -j "$(nproc)" -- "$@"; } </dev/null >"$log" 2>&1; then
    grep -nE 'error|Error' "$log" | head -n 20 >&2 || true
    tail -n 20 "$log" >&2
    return 1
  fi
}

# Makes the built package known to roslaunch and its friends.
enter_workspace() {
  set +u
  # shellcheck disable=SC1091
  . build/devel/setup.bash
  set -u
  export ROS_PACKAGE_PATH="$PWD:${ROS_PACKAGE_PATH:-/usr/share}"
  export ROS_HOSTNAME="${ROS_HOSTNAME:-localhost}"
}

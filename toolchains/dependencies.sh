#!/usr/bin/env bash
# The Debian 12 packages this project needs on a development or CI machine. Nothing is ever downloaded another way.
#   toolchains/dependencies.sh            list them
#   toolchains/dependencies.sh --missing  list those that are not installed
#   toolchains/dependencies.sh --install  install the missing ones (needs root, or sudo)
set -euo pipefail

build="g++ cmake ninja-build ccache pkg-config git"
middleware="libfastrtps-dev libfastcdr-dev cyclonedds-dev cyclonedds-tools libiceoryx-posh-dev libiceoryx-binding-c-dev iceoryx libssl-dev"
libraries="libeigen3-dev libspdlog-dev libfmt-dev libyaml-cpp-dev libcli11-dev nlohmann-json3-dev libtbb-dev libceres-dev libembree-dev
  libpcl-dev libopencv-dev libpng-dev libsqlite3-dev libzstd-dev liblz4-dev"
checking="libgtest-dev libgmock-dev libbenchmark-dev clang clang-format clang-tidy libclang-rt-14-dev fastddsgen iproute2 procps"
packages=$(echo $build $middleware $libraries $checking)

missing() {
  local name
  for name in $packages; do
    dpkg-query -W -f='${db:Status-Status}\n' "$name" 2>/dev/null | grep -qx installed || echo "$name"
  done
}

case "${1:-}" in
  "") echo "$packages" | tr ' ' '\n' ;;
  --missing) missing ;;
  --install)
    wanted=$(missing)
    [ -n "$wanted" ] || exit 0
    echo "installing:" $wanted
    as_root=""
    [ "$(id -u)" = 0 ] || as_root="sudo"
    export DEBIAN_FRONTEND=noninteractive
    $as_root apt-get update -q
    # Recommends of PCL and OpenCV would bring desktop programs that nothing here uses.
    $as_root apt-get install -y -q --no-install-recommends $wanted
    ;;
  *)
    echo "usage: $0 [--missing|--install]" >&2
    exit 2
    ;;
esac

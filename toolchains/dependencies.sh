#!/usr/bin/env bash
# The Debian 12 packages this project needs on a development or CI machine. Nothing is ever downloaded another way.
#   toolchains/dependencies.sh            list them
#   toolchains/dependencies.sh --missing  list those that are not installed
#   toolchains/dependencies.sh --install  install the missing ones (needs root, or sudo)
# A second word names another set than `host`: aarch64 or armhf (cross builds and their tests), board (an emulated board).
set -euo pipefail

build="g++ cmake ninja-build ccache pkg-config git"
middleware="libfastrtps-dev libfastcdr-dev cyclonedds-dev cyclonedds-tools libiceoryx-posh-dev libiceoryx-binding-c-dev iceoryx libssl-dev"
libraries="libeigen3-dev libspdlog-dev libfmt-dev libyaml-cpp-dev libcli11-dev nlohmann-json3-dev libtbb-dev libceres-dev libembree-dev
  libpcl-dev libopencv-dev libpng-dev libsqlite3-dev libzstd-dev liblz4-dev"
checking="libgtest-dev libgmock-dev libbenchmark-dev clang clang-format clang-tidy libclang-rt-14-dev fastddsgen iproute2 procps"
cross="$build cyclonedds-dev cyclonedds-tools qemu-user-static dpkg-dev python3"
case "${2:-host}" in
  host) packages=$(echo $build $middleware $libraries $checking) ;;
  aarch64) packages=$(echo $cross g++-aarch64-linux-gnu) ;;
  armhf) packages=$(echo $cross g++-arm-linux-gnueabihf) ;;
  board) packages=$(echo qemu-system-arm mmdebstrap arch-test kmod cpio openssh-client lintian) ;;
  *) echo "$0: no set '$2': host, aarch64, armhf or board" >&2; exit 2 ;;
esac

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
    echo "usage: $0 [--missing|--install [host|aarch64|armhf|board]]" >&2
    exit 2
    ;;
esac

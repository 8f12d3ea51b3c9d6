# Raspberry Pi 5 and Compute Module 5 (BCM2712, Cortex-A76), 64-bit Raspberry Pi OS 12 or Debian 12.
set(ADIT_BOARD_FLAGS "-mcpu=cortex-a76")
include(${CMAKE_CURRENT_LIST_DIR}/../aarch64.cmake)

# Raspberry Pi 4 and Compute Module 4 (BCM2711, Cortex-A72), 64-bit Raspberry Pi OS 12 or Debian 12.
set(ADIT_BOARD_FLAGS "-mcpu=cortex-a72")
include(${CMAKE_CURRENT_LIST_DIR}/../aarch64.cmake)

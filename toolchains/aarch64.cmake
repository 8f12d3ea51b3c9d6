# Any 64-bit ARM board with Debian 12 (arm64).
set(ADIT_ARCH aarch64)
if(NOT ADIT_BOARD_FLAGS)
  set(ADIT_BOARD_FLAGS "-march=armv8-a")
endif()
include(${CMAKE_CURRENT_LIST_DIR}/cmake/debian_cross.cmake)

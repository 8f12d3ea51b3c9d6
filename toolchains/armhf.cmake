# Any 32-bit ARM board with Debian 12 (armhf: ARMv7-A with VFPv3-D16; NEON is not assumed).
set(ADIT_ARCH armhf)
if(NOT ADIT_BOARD_FLAGS)
  set(ADIT_BOARD_FLAGS "-march=armv7-a+fp -D_FILE_OFFSET_BITS=64")
endif()
include(${CMAKE_CURRENT_LIST_DIR}/cmake/debian_cross.cmake)

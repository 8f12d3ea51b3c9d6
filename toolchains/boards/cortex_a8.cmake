# Cortex-A8 boards (BeagleBone Black: AM335x).
set(ADIT_BOARD_FLAGS "-mcpu=cortex-a8 -mfpu=neon -mfloat-abi=hard -D_FILE_OFFSET_BITS=64")
include(${CMAKE_CURRENT_LIST_DIR}/../armhf.cmake)

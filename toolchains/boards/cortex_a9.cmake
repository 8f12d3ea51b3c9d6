# Cortex-A9 boards with NEON (i.MX6, Zynq-7000).
set(ADIT_BOARD_FLAGS "-mcpu=cortex-a9 -mfpu=neon -mfloat-abi=hard -D_FILE_OFFSET_BITS=64")
include(${CMAKE_CURRENT_LIST_DIR}/../armhf.cmake)

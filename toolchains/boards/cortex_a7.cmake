# Cortex-A7 boards (i.MX7, i.MX6ULL, STM32MP1, Raspberry Pi 2).
set(ADIT_BOARD_FLAGS "-mcpu=cortex-a7 -mfpu=neon-vfpv4 -mfloat-abi=hard -D_FILE_OFFSET_BITS=64")
include(${CMAKE_CURRENT_LIST_DIR}/../armhf.cmake)

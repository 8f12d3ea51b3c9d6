# Jetson Orin (Cortex-A78AE). Jetson Linux is Ubuntu with an older glibc: run the packages in a Debian 12 container.
set(ADIT_BOARD_FLAGS "-mcpu=cortex-a78ae")
include(${CMAKE_CURRENT_LIST_DIR}/../aarch64.cmake)

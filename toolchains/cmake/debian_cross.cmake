# What every board shares; the including file has set ADIT_ARCH (aarch64 or armhf) and ADIT_BOARD_FLAGS.
if(ADIT_ARCH STREQUAL "aarch64")
  set(_triple aarch64-linux-gnu)
  set(_emulator qemu-aarch64)
  set(CMAKE_SYSTEM_PROCESSOR aarch64)
else()
  set(_triple arm-linux-gnueabihf)
  set(_emulator qemu-arm)
  set(CMAKE_SYSTEM_PROCESSOR armv7l)
endif()
set(CMAKE_SYSTEM_NAME Linux)

# The sysroot: -DADIT_SYSROOT=, else the environment, else where toolchains/sysroot puts it.
if(NOT ADIT_SYSROOT)
  if(DEFINED ENV{ADIT_SYSROOT})
    set(ADIT_SYSROOT $ENV{ADIT_SYSROOT})
  else()
    get_filename_component(ADIT_SYSROOT ${CMAKE_CURRENT_LIST_DIR}/../../build/sysroot/${ADIT_ARCH} ABSOLUTE)
  endif()
endif()
if(NOT EXISTS ${ADIT_SYSROOT}/.made_by)
  message(FATAL_ERROR "no sysroot in ${ADIT_SYSROOT}: run toolchains/sysroot ${ADIT_ARCH}")
endif()
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES ADIT_SYSROOT)
set(CMAKE_SYSROOT ${ADIT_SYSROOT})

set(CMAKE_C_COMPILER ${_triple}-gcc)
set(CMAKE_CXX_COMPILER ${_triple}-g++)
set(CMAKE_LIBRARY_ARCHITECTURE ${_triple})
set(CMAKE_C_FLAGS_INIT "${ADIT_BOARD_FLAGS}")
set(CMAKE_CXX_FLAGS_INIT "${ADIT_BOARD_FLAGS}")

set(CMAKE_FIND_ROOT_PATH ${ADIT_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)  # idlc and friends run on the machine that builds
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${ADIT_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR} ${ADIT_SYSROOT}/usr/lib/${_triple}/pkgconfig:${ADIT_SYSROOT}/usr/share/pkgconfig)

foreach(_kind EXE SHARED MODULE)
  set(CMAKE_${_kind}_LINKER_FLAGS_INIT "-Wl,-rpath-link,${ADIT_SYSROOT}/usr/lib/${_triple}")
endforeach()

# Tests run through the emulator.
find_program(ADIT_EMULATOR NAMES ${_emulator} ${_emulator}-static)
if(ADIT_EMULATOR)
  set(CMAKE_CROSSCOMPILING_EMULATOR ${ADIT_EMULATOR};-L;${ADIT_SYSROOT})
endif()

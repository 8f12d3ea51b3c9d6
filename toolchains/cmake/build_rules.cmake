# The few rules every folder's CMakeLists.txt is written with. Include paths are the project root (and the generated
# types), so an #include line names the folder it reaches into: "components/runtime/component.hpp".
include(GoogleTest)

# One interface target carries language level, warnings and sanitizers; everything we compile links it.
add_library(adit_build INTERFACE)
target_compile_features(adit_build INTERFACE cxx_std_20)
target_compile_options(adit_build INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual
                                            -Wno-psabi)
if(ADIT_WARNINGS_AS_ERRORS)
  target_compile_options(adit_build INTERFACE -Werror)
endif()
target_include_directories(adit_build INTERFACE ${PROJECT_SOURCE_DIR})
if(ADIT_SANITIZE)
  target_compile_options(adit_build INTERFACE -fsanitize=${ADIT_SANITIZE} -fno-omit-frame-pointer
                                              -fno-sanitize-recover=all)
  # Instrumented code misleads these two of GCC (its manual, -fsanitize); the other presets keep them as errors.
  target_compile_options(adit_build INTERFACE
                         $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-maybe-uninitialized;-Wno-mismatched-new-delete>)
  # Eigen aligns by hand under AddressSanitizer, unlike in the distribution's libraries built on it (Ceres), whose
  # inline functions the linker may take for ours: memory of one kind would be freed as the other.
  target_compile_definitions(adit_build INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
  target_link_options(adit_build INTERFACE -fsanitize=${ADIT_SANITIZE})
endif()

# adit_library(NAME SOURCES a.cpp ... [LINKS ...] [PRIVATE_LINKS ...]): a plain library, target adit_NAME.
# Shared in the developer presets, static in the one-vendor ones (BUILD_SHARED_LIBS decides).
function(adit_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS;PRIVATE_LINKS" ${ARGN})
  add_library(adit_${name} ${ARG_SOURCES})
  target_link_libraries(adit_${name} PUBLIC adit_build ${ARG_LINKS} PRIVATE ${ARG_PRIVATE_LINKS})
  set_target_properties(adit_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
endfunction()

# adit_test(NAME LABEL unit|contract|loopback|wire|integration|slow SOURCES ... [LINKS ...] [TIMEOUT s] [SERIAL]):
# one GoogleTest program; each of its tests is a ctest of its own.
function(adit_test name)
  cmake_parse_arguments(ARG "SERIAL" "LABEL;TIMEOUT" "SOURCES;LINKS" ${ARGN})
  if(NOT ADIT_BUILD_TESTS)
    return()
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)  # only ends a test that hangs: seconds here, many times that on a loaded or emulated machine
  endif()
  if(CMAKE_CROSSCOMPILING OR ADIT_SANITIZE)
    math(EXPR ARG_TIMEOUT "${ARG_TIMEOUT} * 10")  # an emulated processor, instrumented code
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE adit_build ${ARG_LINKS} GTest::gmock_main)
  # Tests find ../shared from here when ADIT_SHARED is not set.
  target_compile_definitions(${name} PRIVATE ADIT_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  set(properties LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT})
  # Real traffic runs alone: what a test then sees lost or late is the middleware's doing, not its neighbours'.
  if(ARG_SERIAL OR ARG_LABEL MATCHES "^(contract|loopback|integration)$")
    list(APPEND properties RUN_SERIAL ON)
  endif()
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST TEST_PREFIX "${name}." PROPERTIES ${properties})
endfunction()

# adit_component(TYPE SOURCES a.cpp ... [LINKS ...]): a component by the name ADIT_COMPONENT gives it. A module
# libadit_component_TYPE.so that is loaded by name; with static libraries an object library that adit_link_components
# puts into a program (its registration would be lost in an archive).
function(adit_component type)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  if(BUILD_SHARED_LIBS)
    add_library(adit_component_${type} MODULE ${ARG_SOURCES})
  else()
    add_library(adit_component_${type} OBJECT ${ARG_SOURCES})
  endif()
  target_link_libraries(adit_component_${type} PRIVATE adit_build adit_runtime ${ARG_LINKS})
  set_target_properties(adit_component_${type} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  set_property(GLOBAL APPEND PROPERTY ADIT_COMPONENTS ${type})
endfunction()

# adit_link_components(TARGET [TYPE ...]): without types, all components defined so far. With shared libraries they are
# built with the program and loaded when they are asked for; with static ones they are linked into it.
function(adit_link_components target)
  set(types ${ARGN})
  if(NOT types)
    get_property(types GLOBAL PROPERTY ADIT_COMPONENTS)
  endif()
  foreach(type IN LISTS types)
    if(BUILD_SHARED_LIBS)
      add_dependencies(${target} adit_component_${type})
    else()
      # An object library's objects and what they need; PRIVATE links do not come along by themselves.
      target_link_libraries(${target} PRIVATE adit_component_${type}
                            $<TARGET_PROPERTY:adit_component_${type},LINK_LIBRARIES>)
    endif()
  endforeach()
endfunction()

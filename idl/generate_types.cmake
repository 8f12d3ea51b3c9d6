# adit_generate_types(FILES <package>/<module>/<Type>.idl ... OUTPUT folder): one idlc call a file. Sets
# adit_codec_sources and adit_registry_sources in the caller's scope.
#
# A file may be included by several others, and idlc refuses to read it twice; but rosidl's grammar knows no #pragma once
# and no #ifndef, and a ROS 2 workspace must be able to build the same files. So #include finds wrappers that are read once.
function(adit_generate_types)
  cmake_parse_arguments(ARG "" "OUTPUT" "FILES" ${ARGN})
  set(ADIT_TYPE_DECLARATIONS "")
  set(ADIT_TYPE_CALLS "")
  foreach(file IN LISTS ARG_FILES)
    get_filename_component(folder ${file} DIRECTORY)
    get_filename_component(type ${file} NAME_WE)
    # rosidl's rule for file names: PointCloud2 -> point_cloud2, TFMessage -> tf_message.
    string(REGEX REPLACE "(.)([A-Z][a-z]+)" "\\1_\\2" snake ${type})
    string(REGEX REPLACE "([a-z0-9])([A-Z])" "\\1_\\2" snake ${snake})
    string(TOLOWER ${snake} snake)
    set(stem ${ARG_OUTPUT}/${folder}/${snake})
    file(CONFIGURE OUTPUT ${ARG_OUTPUT}/include_once/${file}
         CONTENT "#pragma once\n#include \"${CMAKE_CURRENT_SOURCE_DIR}/${file}\"\n")
    add_custom_command(
      OUTPUT ${stem}.hpp ${stem}.cpp ${stem}_entry.cpp
      COMMAND ${ADIT_IDLC} -l ${adit_idlc_backend} -f case-sensitive -x final -I ${ARG_OUTPUT}/include_once -o ${ARG_OUTPUT}
              ${CMAKE_CURRENT_SOURCE_DIR}/${file}
      DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${file} ${adit_idlc_backend}
      DEPFILE ${stem}.d
      COMMENT "idlc ${file}" VERBATIM)
    list(APPEND codec_sources ${stem}.cpp ${stem}.hpp)
    list(APPEND registry_sources ${stem}_entry.cpp)
    # Compiled package by package: a new type leaves the others alone.
    string(REGEX MATCH "^[^/]+" package ${file})
    set_source_files_properties(${stem}.cpp ${stem}_entry.cpp PROPERTIES UNITY_GROUP ${package})
    string(REPLACE "/" "_" function types_of_${folder}_${type})
    string(APPEND ADIT_TYPE_DECLARATIONS "std::span<const MessageType> ${function}();\n")
    string(APPEND ADIT_TYPE_CALLS "             registry::${function},\n")
  endforeach()
  file(MAKE_DIRECTORY ${ARG_OUTPUT})
  configure_file(${CMAKE_CURRENT_SOURCE_DIR}/type_registry.cpp.in ${ARG_OUTPUT}/type_registry.cpp @ONLY)
  set(adit_codec_sources ${codec_sources} PARENT_SCOPE)
  set(adit_registry_sources ${registry_sources} ${ARG_OUTPUT}/type_registry.cpp PARENT_SCOPE)
endfunction()

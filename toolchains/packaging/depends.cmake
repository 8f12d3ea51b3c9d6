# Run by CPack: the Depends of each component's package.
set(adit_needs_framework "")
set(adit_needs_localization "adit-framework (= ${CPACK_PACKAGE_VERSION}), ")
set(adit_needs_tools "${adit_needs_localization}")
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  execute_process(COMMAND python3 ${adit_packaging}/depends.py ${adit_shlibs} ${adit_files_${component}}
                  OUTPUT_VARIABLE found OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "adit-${component}: its dependencies cannot be told")
  endif()
  string(TOUPPER ${component} name)
  set(CPACK_DEBIAN_${name}_PACKAGE_DEPENDS "${adit_needs_${component}}${found}")
endforeach()

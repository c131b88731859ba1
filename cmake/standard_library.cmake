# One C++ standard library a process. Where the compiler's folder has libstdc++.a but no libstdc++.so (compilers unpacked
# outside /usr), g++ puts a static copy into every program without a word. Shared libraries (libtorch, OpenVDB) bring
# libstdc++.so.6 along, and two copies differ in their thread-local state: std::call_once inside libtorch then calls a
# function through the other copy's null pointer. Such programs are linked to libstdc++.so.6 by name.
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU" OR NOT CMAKE_READELF)
  return()
endif()

set(probe ${CMAKE_BINARY_DIR}/CMakeFiles/standard_library)
file(WRITE ${probe}/probe.cpp "#include <iostream>\nint main() { std::cout << 1; }\n")
# graupel_links_shared(result arguments..): whether a program linked with these arguments needs libstdc++.so.6.
function(graupel_links_shared result)
  execute_process(COMMAND ${CMAKE_CXX_COMPILER} ${probe}/probe.cpp -o ${probe}/probe ${ARGN} RESULT_VARIABLE status
                  OUTPUT_QUIET ERROR_QUIET)
  execute_process(COMMAND ${CMAKE_READELF} -d ${probe}/probe OUTPUT_VARIABLE dynamic ERROR_QUIET)
  if(status EQUAL 0 AND dynamic MATCHES "NEEDED[^\n]*libstdc\\+\\+\\.so")
    set(${result} ON PARENT_SCOPE)
  else()
    set(${result} OFF PARENT_SCOPE)
  endif()
endfunction()

separate_arguments(linker_flags NATIVE_COMMAND "${CMAKE_EXE_LINKER_FLAGS}")
graupel_links_shared(shared ${linker_flags})
if(NOT shared)
  find_library(GRAUPEL_LIBSTDCXX NAMES libstdc++.so.6 PATHS /lib/x86_64-linux-gnu /usr/lib/x86_64-linux-gnu /lib64 /usr/lib64
               NO_CMAKE_FIND_ROOT_PATH)
  if(GRAUPEL_LIBSTDCXX)
    graupel_links_shared(shared ${linker_flags} ${GRAUPEL_LIBSTDCXX})
  endif()
  if(shared)
    message(STATUS "Graupel: ${CMAKE_CXX_COMPILER} would link libstdc++ statically; using ${GRAUPEL_LIBSTDCXX}")
    link_libraries(${GRAUPEL_LIBSTDCXX})
  else()
    message(WARNING "Graupel: ${CMAKE_CXX_COMPILER} links libstdc++ statically, and no libstdc++.so.6 that fits was found. "
                    "Programs that load libtorch may crash. Install the compiler's shared libstdc++, or set GRAUPEL_LIBSTDCXX.")
  endif()
endif()

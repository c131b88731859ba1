# `cmake --install`: programs, the C++ library with its package for find_package(Graupel), models, scenes, tools, docs.
include(CMakePackageConfigHelpers)

# Public headers: these and what they include, with "core/math/vec.h" as "graupel/core/math/vec.h". Only headers in these
# places may be public; tests/package compiles each one alone.
set(graupel_public_places "core/math/" "core/scene/" "core/system/error.h" "core/parallel/device.h" "core/parallel/host_device.h"
    "io/scene/scene_reader.h" "io/trajectory/trajectory_file.h" "mpm/materials/user_material.h" "library/")
set(headers library/io.h library/mpm.h library/batch.h library/graph.h library/rom.h core/math/svd.h core/math/polar.h)
set(public_headers "")
while(headers)
  list(POP_FRONT headers header)
  set(is_public OFF)
  foreach(place ${graupel_public_places})
    string(FIND "${header}" "${place}" at)
    if(at EQUAL 0)
      set(is_public ON)
    endif()
  endforeach()
  if(NOT is_public)
    message(FATAL_ERROR "Graupel: the public headers include '${header}' (allowed: ${graupel_public_places}). Hide it in library/*.cpp")
  endif()
  list(APPEND public_headers ${header})
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${header})
  file(READ ${header} text)
  string(REGEX MATCHALL "#include \"[^\"]+\"" includes "${text}")
  foreach(include ${includes})
    string(REGEX REPLACE "#include \"(.*)\"" "\\1" included "${include}")
    if(NOT included IN_LIST public_headers)
      list(APPEND headers ${included})
    endif()
  endforeach()
  list(REMOVE_DUPLICATES headers)
  string(REPLACE "#include \"library/" "#include \"graupel/" text "${text}")
  string(REGEX REPLACE "#include \"(core|io|mpm)/" "#include \"graupel/\\1/" text "${text}")
  string(REGEX REPLACE "^library/" "" installed "${header}")
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/include/graupel/${installed} CONTENT "${text}" @ONLY)
endwhile()
install(DIRECTORY ${PROJECT_BINARY_DIR}/include/graupel DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT library)

# The library: public targets, and the modules behind them.
set(targets graupel_public_io graupel_public_mpm graupel_public_graph graupel_public_rom)
foreach(module core io nn sparsegrid mpm graph compare rom hybrid experiments)
  list(APPEND targets graupel_${module})
  set_target_properties(graupel_${module} PROPERTIES EXPORT_NAME module_${module})
endforeach()
install(TARGETS ${targets} EXPORT GraupelTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library)
if(GRAUPEL_SHARED)
  set_target_properties(${targets} PROPERTIES INSTALL_RPATH $ORIGIN)
endif()
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/Graupel)
install(EXPORT GraupelTargets NAMESPACE graupel:: DESTINATION ${package} COMPONENT library)
configure_package_config_file(cmake/GraupelConfig.cmake.in ${PROJECT_BINARY_DIR}/GraupelConfig.cmake
  INSTALL_DESTINATION ${package} PATH_VARS CMAKE_INSTALL_DATADIR CMAKE_INSTALL_LIBEXECDIR)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/GraupelConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/GraupelConfig.cmake ${PROJECT_BINARY_DIR}/GraupelConfigVersion.cmake
  DESTINATION ${package} COMPONENT library)

# Programs find each other in their own folder, and tools, models and scenes in ../share/graupel.
if(GRAUPEL_SHARED)
  file(RELATIVE_PATH libraries ${CMAKE_INSTALL_FULL_BINDIR} ${CMAKE_INSTALL_FULL_LIBDIR})
  set_target_properties(${programs} PROPERTIES INSTALL_RPATH $ORIGIN/${libraries})
  foreach(module apps validation bench train)
    if(TARGET graupel_${module})
      set_target_properties(graupel_${module} PROPERTIES INSTALL_RPATH $ORIGIN)
      install(TARGETS graupel_${module} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT programs)
    endif()
  endforeach()
endif()
# Files are checked by processes of their own (core/system/checks/file_check.h): programs and users of the library find them.
set(checkers graupel-check-hdf5 graupel-check-vdb graupel-check-vdb-library)
install(TARGETS ${checkers} RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/graupel COMPONENT checkers)
# Libraries outside of the system's folders (PyTorch's packages) are found where they were linked.
set_target_properties(${programs} ${checkers} PROPERTIES INSTALL_RPATH_USE_LINK_PATH ON)
install(TARGETS ${programs} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)
set(share ${CMAKE_INSTALL_DATADIR}/graupel)
install(DIRECTORY models scenes DESTINATION ${share} COMPONENT data)
install(DIRECTORY tools DESTINATION ${share} COMPONENT programs PATTERN __pycache__ EXCLUDE)
install(DIRECTORY library/python/graupel/convert/ DESTINATION ${share}/tools/graupel_convert COMPONENT programs
  PATTERN __pycache__ EXCLUDE)
install(DIRECTORY docs examples DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT docs PATTERN site EXCLUDE)
install(FILES README.md CHANGELOG.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT docs)

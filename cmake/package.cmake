# `cpack`: Debian packages of what is installed. graupel has programs, models, scenes and docs; libgraupel-dev the C++
# library. Configure with --preset deb, so that they run on any x86-64 processor (docs/guide/package.md).
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME graupel)
set(CPACK_PACKAGE_VENDOR "The Graupel authors")
set(CPACK_PACKAGE_CONTACT "The Graupel authors <graupel@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL programs data docs library)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENT_PROGRAMS_GROUP programs)
set(CPACK_COMPONENT_DATA_GROUP programs)
set(CPACK_COMPONENT_DOCS_GROUP programs)
set(CPACK_COMPONENT_LIBRARY_GROUP library)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME graupel)
set(CPACK_DEBIAN_PROGRAMS_DESCRIPTION
  "Material point method and learned simulators\n Water, sand, snow and solids among obstacles: an explicit material point method, graph\n networks and reduced models that compete with it, and their comparison in error and time.")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS "python3, python3-numpy, python3-h5py, ffmpeg")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libgraupel-dev)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_LIBRARY_DESCRIPTION
  "Material point method and learned simulators, C++ library\n Headers, static libraries and the package for find_package(Graupel).")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_DEPENDS
  "graupel (= ${PROJECT_VERSION}), libopenvdb-dev, libhdf5-dev, libtbb-dev, libboost-iostreams-dev, libpng-dev, zlib1g-dev, libfmt-dev")
include(CPack)

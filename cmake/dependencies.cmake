# Third-party libraries, all from the distribution's packages (README.md names them).
find_package(Threads REQUIRED)
find_package(OpenMP REQUIRED COMPONENTS CXX)
find_package(CLI11 REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(nlohmann_json REQUIRED)
find_package(fmt REQUIRED)
find_package(HDF5 REQUIRED COMPONENTS C)
find_package(PNG REQUIRED)
find_package(TBB REQUIRED)
find_package(ZLIB REQUIRED)
# Expands trajectories two to three times as fast; zlib serves without it.
find_path(GRAUPEL_LIBDEFLATE_HEADERS libdeflate.h)
find_library(GRAUPEL_LIBDEFLATE deflate)

add_library(graupel_hdf5 INTERFACE)
target_include_directories(graupel_hdf5 SYSTEM INTERFACE ${HDF5_INCLUDE_DIRS})
target_compile_definitions(graupel_hdf5 INTERFACE ${HDF5_DEFINITIONS})
target_link_libraries(graupel_hdf5 INTERFACE ${HDF5_C_LIBRARIES})

# OpenVDB ships FindOpenVDB.cmake instead of a config file.
foreach(dir ${CMAKE_PREFIX_PATH} /usr)
  list(APPEND CMAKE_MODULE_PATH ${dir}/lib/x86_64-linux-gnu/cmake/OpenVDB ${dir}/lib/cmake/OpenVDB)
endforeach()
set(OPENVDB_USE_STATIC_LIBS OFF)
find_package(OpenVDB REQUIRED)
# Expands the values of OpenVDB's files, which are packed by it.
find_library(GRAUPEL_BLOSC blosc REQUIRED)

# A BLAS with run-time dispatch makes the CPU inference faster; Eigen's own kernels serve without one.
find_library(GRAUPEL_OPENBLAS NAMES openblas PATH_SUFFIXES openblas-openmp openblas-pthread)

# Header-only libraries without CMake files; /usr/include itself must not be passed as -isystem.
find_path(GRAUPEL_RANDOM123 Random123/philox.h REQUIRED)
find_path(GRAUPEL_NANOVDB nanovdb/NanoVDB.h REQUIRED)
add_library(graupel_headers INTERFACE)
foreach(folder ${GRAUPEL_RANDOM123} ${GRAUPEL_NANOVDB})
  if(NOT folder STREQUAL "/usr/include")
    target_include_directories(graupel_headers SYSTEM INTERFACE ${folder})
  endif()
endforeach()

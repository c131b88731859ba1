# Compiler settings: C++20, warnings, optimisation, and CUDA where a usable nvcc is found.
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")

find_program(GRAUPEL_CCACHE ccache)
if(GRAUPEL_CCACHE)
  # Without this ccache keeps nothing that was compiled with precompiled headers.
  set(CMAKE_CXX_COMPILER_LAUNCHER env
    CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${GRAUPEL_CCACHE})
endif()

# nvcc is looked for where CUDA's installers put it; a compiler that cannot build a trivial program turns CUDA off.
set(GRAUPEL_HAVE_CUDA OFF)
if(GRAUPEL_CUDA)
  include(CheckLanguage)
  if(NOT CMAKE_CUDA_COMPILER)
    find_program(GRAUPEL_NVCC nvcc HINTS ENV CUDACXX ENV CUDA_HOME ENV CUDA_PATH /usr/local/cuda PATH_SUFFIXES bin)
    unset(CMAKE_CUDA_COMPILER CACHE) # a remembered NOTFOUND
    if(GRAUPEL_NVCC)
      set(ENV{CUDACXX} ${GRAUPEL_NVCC}) # check_language tests no compiler that CMAKE_CUDA_COMPILER names already
    endif()
  endif()
  # For the GPUs of this machine; where there are none, for all that Graupel is measured on, and later ones.
  if(NOT CMAKE_CUDA_ARCHITECTURES)
    execute_process(COMMAND nvidia-smi --query-gpu=compute_cap --format=csv,noheader
      OUTPUT_VARIABLE capabilities ERROR_QUIET RESULT_VARIABLE no_gpu OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(no_gpu OR NOT capabilities MATCHES "^[0-9.\n]+$")
      set(CMAKE_CUDA_ARCHITECTURES 80-real 90a-real 90-virtual)
    else()
      string(REGEX REPLACE "([0-9]+)\\.([0-9]+)\n?" "\\1\\2-real;" CMAKE_CUDA_ARCHITECTURES "${capabilities}")
      string(REPLACE "90-real" "90a-real" CMAKE_CUDA_ARCHITECTURES "${CMAKE_CUDA_ARCHITECTURES}")
      list(REMOVE_DUPLICATES CMAKE_CUDA_ARCHITECTURES)
      list(REMOVE_ITEM CMAKE_CUDA_ARCHITECTURES "")
    endif()
  endif()
  set(CMAKE_CUDA_FLAGS_INIT "")
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    enable_language(CUDA)
    find_package(CUDAToolkit REQUIRED)
    # -DCMAKE_CUDA_RUNTIME_LIBRARY=Static: for machines that have NVIDIA's driver alone.
    if(CMAKE_CUDA_RUNTIME_LIBRARY STREQUAL "Static")
      set(GRAUPEL_CUDA_RUNTIME CUDA::cudart_static)
    else()
      set(GRAUPEL_CUDA_RUNTIME CUDA::cudart)
    endif()
    set(GRAUPEL_HAVE_CUDA ON)
    # CMake 3.25 does not know that CUDA 13's nvcc takes C++20.
    set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION "-std=c++20")
    set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION "-std=c++20")
    set(CMAKE_CUDA_STANDARD 20)
    if(GRAUPEL_CCACHE)
      set(CMAKE_CUDA_COMPILER_LAUNCHER ${GRAUPEL_CCACHE})
    endif()
  else()
    message(STATUS "Graupel: no usable nvcc was found; building for the CPU only")
  endif()
endif()

# Everything that graupel_fuzz links is watched and tells libFuzzer where it has been.
if(GRAUPEL_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    message(FATAL_ERROR "GRAUPEL_FUZZ needs clang++ (this is ${CMAKE_CXX_COMPILER_ID}). Use 'cmake --preset fuzz'")
  endif()
  # What is compared is not traced: the targets change inputs by their structure, and are twice as fast without.
  add_compile_options(-O2 -gline-tables-only -fno-omit-frame-pointer -fsanitize=address,undefined,float-cast-overflow,fuzzer-no-link
    -fno-sanitize-coverage=trace-cmp -fno-sanitize-recover=undefined,float-cast-overflow)
  add_link_options(-fsanitize=address,undefined)
endif()

# Hot loops of the CPU are compiled for several instruction sets there (cmake/module.cmake).
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  set(GRAUPEL_X86_KERNELS ON)
endif()

set(GRAUPEL_CXX_OPTIONS -Wall -Wextra -Wshadow -Wno-unknown-pragmas)
if(GRAUPEL_WERROR)
  list(APPEND GRAUPEL_CXX_OPTIONS -Werror)
endif()
# Inlined functions of the reduced models return vectors wider than some processors' registers; nothing outside calls
# them.
list(APPEND GRAUPEL_CXX_OPTIONS -Wno-psabi)
if(GRAUPEL_NATIVE)
  list(APPEND GRAUPEL_CXX_OPTIONS -march=native)
endif()

# Sanitizers (./run sanitize) and counts of lines (./run coverage): everything of this tree is compiled with them, the
# libraries of the system are not.
# Presets switch GRAUPEL_WERROR off: with their checks in the code the compiler warns of what is not there.
set(GRAUPEL_SANITIZE "" CACHE STRING "address (with undefined), thread, coverage, or nothing")
if(GRAUPEL_SANITIZE STREQUAL "address")
  set(sanitizers -fsanitize=address,undefined -fsanitize-recover=address,undefined -D_GLIBCXX_ASSERTIONS)
  if(GRAUPEL_X86_KERNELS AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # gcc 13's copies of 64 bytes crashed; the alignment of the sanitizer's stack is suspected (docs/lab/sanitizers.md).
    list(APPEND sanitizers -mmove-max=256 -mstore-max=256 -mprefer-vector-width=256)
  endif()
elseif(GRAUPEL_SANITIZE STREQUAL "thread")
  set(sanitizers -fsanitize=thread -Wno-tsan -DEIGEN_DONT_PARALLELIZE) # OpenMP's barriers are not seen
elseif(GRAUPEL_SANITIZE STREQUAL "coverage")
  set(sanitizers --coverage -fprofile-update=atomic)
elseif(GRAUPEL_SANITIZE)
  message(FATAL_ERROR "GRAUPEL_SANITIZE is '${GRAUPEL_SANITIZE}' (allowed: address, thread, coverage, or nothing)")
endif()
if(GRAUPEL_SANITIZE)
  add_compile_options(${sanitizers} -O1 -g1 -fno-omit-frame-pointer)
  add_link_options(${sanitizers})
endif()

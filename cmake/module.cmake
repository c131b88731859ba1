# graupel_module(name PORTABLE a.cpp.. SOURCES b.cpp.. DEPENDS core.. LIBRARIES fmt::fmt.. PRECOMPILE fmt/format.h..)
#   One library per folder, static unless GRAUPEL_SHARED is on, called graupel_<name>. PORTABLE sources hold kernels: they are compiled as CUDA
#   where nvcc is in use and as C++ elsewhere. DEPENDS lists the folders this one may include (tests/architecture checks).
function(graupel_compile_settings target)
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:${GRAUPEL_CXX_OPTIONS}>)
  graupel_link(${target} OpenMP::OpenMP_CXX graupel_headers)
  if(GRAUPEL_HAVE_CUDA)
    set(host_options -Wall,-Wextra)
    set(nvcc_options --expt-relaxed-constexpr)
    if(GRAUPEL_NATIVE)
      string(APPEND host_options ,-march=native)
    endif()
    if(GRAUPEL_WERROR)
      string(APPEND host_options ,-Werror)
      string(APPEND nvcc_options " -Werror all-warnings")
    endif()
    target_compile_options(${target} PRIVATE
      "$<$<COMPILE_LANGUAGE:CUDA>:SHELL:${nvcc_options} -Xcompiler ${host_options},-fopenmp -diag-suppress 20012,20013,20014,20015>")
    target_compile_definitions(${target} PUBLIC $<BUILD_INTERFACE:GRAUPEL_HAVE_CUDA=1>)
    graupel_link(${target} ${GRAUPEL_CUDA_RUNTIME})
  endif()
endfunction()

# graupel_link(target library..): links other libraries publicly here. Users of the installed package, whose headers show
#   none of them, link what is compiled (cmake/GraupelConfig.cmake.in finds it) and need nothing of the others.
set(graupel_only_headers graupel_headers nlohmann_json::nlohmann_json Eigen3::Eigen)
function(graupel_link target)
  foreach(library ${ARGN})
    target_link_libraries(${target} PUBLIC $<BUILD_INTERFACE:${library}>)
    if(NOT library IN_LIST graupel_only_headers)
      string(REPLACE "graupel_hdf5" "graupel::hdf5" installed ${library})
      target_link_libraries(${target} PUBLIC $<INSTALL_INTERFACE:$<LINK_ONLY:${installed}>>)
    endif()
  endforeach()
endfunction()

set(graupel_library_type STATIC)
if(GRAUPEL_SHARED)
  set(graupel_library_type SHARED)
endif()
function(graupel_module name)
  cmake_parse_arguments(MODULE "" "" "PORTABLE;SOURCES;DEPENDS;LIBRARIES;PRECOMPILE" ${ARGN})
  add_library(graupel_${name} ${graupel_library_type} ${MODULE_PORTABLE} ${MODULE_SOURCES})
  set_target_properties(graupel_${name} PROPERTIES DEFINE_SYMBOL "")
  graupel_compile_settings(graupel_${name})
  if(GRAUPEL_HAVE_CUDA AND MODULE_PORTABLE)
    set_source_files_properties(${MODULE_PORTABLE} PROPERTIES LANGUAGE CUDA)
  endif()
  foreach(dependency ${MODULE_DEPENDS})
    target_link_libraries(graupel_${name} PUBLIC graupel_${dependency})
  endforeach()
  graupel_link(graupel_${name} ${MODULE_LIBRARIES})
  if(MODULE_PRECOMPILE)
    graupel_precompile(graupel_${name} ${MODULE_PRECOMPILE})
  else()
    graupel_precompile(graupel_${name} SHARED graupel_standard)
  endif()
  set_property(GLOBAL PROPERTY GRAUPEL_DEPENDS_${name} "${MODULE_DEPENDS}")
endfunction()

# graupel_precompile(target header..): the standard library's headers and these ones of other libraries, which many of a
#   target's C++ files include, are parsed once. graupel_precompile(target SHARED other): those of another target.
#   No header of Graupel: an edit of one would compile the whole target. Files still include what they use.
set(graupel_standard_headers algorithm array cmath cstdint filesystem functional map memory numeric optional stdexcept string
    utility vector)
function(graupel_precompile target)
  # Headers that do not fit are parsed again with a warning. ccache needs to see them in preprocessed text.
  target_compile_options(${target} PRIVATE
    "$<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CXX_COMPILER_ID:GNU>>:-Wno-error=invalid-pch;-fpch-preprocess>")
  cmake_parse_arguments(PCH "" "SHARED" "" ${ARGN})
  if(PCH_SHARED)
    target_precompile_headers(${target} REUSE_FROM ${PCH_SHARED})
    return()
  endif()
  set(headers "")
  foreach(header ${graupel_standard_headers} ${PCH_UNPARSED_ARGUMENTS})
    list(APPEND headers "$<$<COMPILE_LANGUAGE:CXX>:<${header}$<ANGLE-R>>")
  endforeach()
  target_precompile_headers(${target} PRIVATE ${headers})
endfunction()

# graupel_precompiled(target header..): the headers that others share, once `target` is there: an object library for
#   libraries, a program for programs, which are compiled with other options.
function(graupel_precompiled target)
  graupel_compile_settings(${target})
  graupel_precompile(${target} ${ARGN})
endfunction()

# graupel_folders(name "sub/folder: others.." ..): the sub-folders of module `name` with those that their files may include
#   (tests/architecture checks). One that is not named belongs to the folder above it.
function(graupel_folders name)
  set_property(GLOBAL PROPERTY GRAUPEL_FOLDERS_${name} "${ARGN}")
endfunction()

# graupel_quick_to_compile(target): for code that parses, calls and prints: -O1 compiles in 60 % of the time of -O3.
#   There GCC 12 sees overruns in std::string's operator+ that do not exist (GCC bugs 105329, 105651).
function(graupel_quick_to_compile target)
  if(NOT GRAUPEL_FUZZ) # which runs it a million times
    target_compile_options(${target} PRIVATE $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CONFIG:Release>>:-O1>)
  endif()
  target_compile_options(${target} PRIVATE
    $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CXX_COMPILER_ID:GNU>>:-Wno-array-bounds -Wno-restrict -Wno-stringop-overflow>)
endfunction()

# graupel_test(name SOURCES a_test.cpp.. PORTABLE k_test.cpp.. DEPENDS mpm.. PRECOMPILE Eigen/Core..): one GoogleTest program, tests/<name>.
#   Tests called *.Slow* are left out by tests/run_all.sh unless it is given --slow.
function(graupel_test name)
  cmake_parse_arguments(TEST "" "" "PORTABLE;SOURCES;DEPENDS;LIBRARIES;PRECOMPILE" ${ARGN})
  add_executable(${name}_test ${TEST_SOURCES} ${TEST_PORTABLE})
  graupel_compile_settings(${name}_test)
  if(GRAUPEL_HAVE_CUDA AND TEST_PORTABLE)
    set_source_files_properties(${TEST_PORTABLE} PROPERTIES LANGUAGE CUDA)
  endif()
  foreach(dependency ${TEST_DEPENDS})
    target_link_libraries(${name}_test PRIVATE graupel_${dependency})
  endforeach()
  target_link_libraries(${name}_test PRIVATE GTest::gtest GTest::gmock GTest::gtest_main ${TEST_LIBRARIES})
  target_compile_definitions(${name}_test PRIVATE GRAUPEL_SOURCE_DIR="${PROJECT_SOURCE_DIR}" GRAUPEL_BINARY_DIR="${PROJECT_BINARY_DIR}")
  # What is tested is compiled with -O3 in its library; the tests' own text compiles in 60 % of the time without.
  graupel_quick_to_compile(${name}_test)
  if(TEST_PRECOMPILE)
    graupel_precompile(${name}_test gtest/gtest.h ${TEST_PRECOMPILE})
  else()
    graupel_precompile(${name}_test SHARED graupel_test_headers)
  endif()
  add_test(NAME ${name} COMMAND ${name}_test)
endfunction()

# graupel_checker(format module SOURCES walk.cpp LIBRARIES hdf5..): graupel-check-<format>, the process that reads files of
#   strangers before `module` does (core/system/checks/file_check.h). It links little, so that it starts fast.
function(graupel_checker format module)
  cmake_parse_arguments(CHECKER "" "" "SOURCES;LIBRARIES" ${ARGN})
  set(checker graupel-check-${format})
  add_executable(${checker} ${CHECKER_SOURCES} ${PROJECT_SOURCE_DIR}/core/system/checks/file_check_child.cpp)
  target_include_directories(${checker} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_options(${checker} PRIVATE ${GRAUPEL_CXX_OPTIONS})
  target_link_libraries(${checker} PRIVATE ${CHECKER_LIBRARIES})
  graupel_quick_to_compile(${checker})
  add_dependencies(graupel_${module} ${checker})
endfunction()

# graupel_kernels(name source.cpp [options..]): the hot loops of module `name`, compiled once for each instruction set with
#   GRAUPEL_ISA its name; the program chooses when it starts (core/parallel/instruction_set.h). They do not take -march=native, and
#   may export nothing but their tables of functions (tests/exported_symbols.h).
set(graupel_instruction_sets baseline)
if(GRAUPEL_X86_KERNELS)
  list(APPEND graupel_instruction_sets avx2 avx512)
  set(graupel_march_baseline -march=x86-64)
  set(graupel_march_avx2 -march=x86-64-v3)
  set(graupel_march_avx512 -march=x86-64-v4)
endif()
function(graupel_kernels name source)
  set(options ${GRAUPEL_CXX_OPTIONS})
  list(REMOVE_ITEM options -march=native)
  foreach(isa ${graupel_instruction_sets})
    set(kernels graupel_${name}_${isa})
    add_library(${kernels} OBJECT ${source})
    target_include_directories(${kernels} PRIVATE ${PROJECT_SOURCE_DIR})
    target_link_libraries(${kernels} PRIVATE graupel_headers)
    target_compile_definitions(${kernels} PRIVATE GRAUPEL_ISA=${isa})
    target_compile_options(${kernels} PRIVATE ${options} ${graupel_march_${isa}} ${ARGN})
    target_sources(graupel_${name} PRIVATE $<TARGET_OBJECTS:${kernels}>)
  endforeach()
  if(GRAUPEL_X86_KERNELS)
    target_compile_definitions(graupel_${name} PRIVATE GRAUPEL_X86_KERNELS)
  endif()
endfunction()

# graupel_test_exports(name): tells the test program of module `name` where the objects of its kernels are.
function(graupel_test_exports name)
  set(objects "")
  foreach(isa ${graupel_instruction_sets})
    list(APPEND objects $<TARGET_OBJECTS:graupel_${name}_${isa}>)
  endforeach()
  target_compile_definitions(${name}_test PRIVATE GRAUPEL_NM="${CMAKE_NM}" "GRAUPEL_KERNEL_OBJECTS=\"$<JOIN:${objects},$<COMMA>>\"")
endfunction()

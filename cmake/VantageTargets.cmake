# How every target of the project is built: warnings, sanitizers, and one function each for libraries, programs, tests
# and benchmarks.

option(VANTAGE_BUILD_TESTS "Build the tests and benchmarks" ON)
set(VANTAGE_SANITIZE "" CACHE STRING "Sanitizers to build with, as -fsanitize= takes them: address,undefined or thread")

option(VANTAGE_FUZZ "Build the fuzz targets (with clang)" OFF)
if(VANTAGE_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link)
endif()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
  set(CMAKE_C_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()

add_library(vantage_warnings INTERFACE)
target_compile_options(vantage_warnings INTERFACE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror)

if(VANTAGE_SANITIZE)
  add_compile_options(-fsanitize=${VANTAGE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${VANTAGE_SANITIZE})
endif()

# vantage_library(NAME SOURCES file... [PUBLIC target...] [PRIVATE target...])
#
# One folder, one static library. Headers are included from the project's root: #include "calib/camera_model.h".
# Foreign targets are taken as SYSTEM, so that only our own code is held to our warnings.
function(vantage_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} vantage_warnings)
endfunction()

# vantage_program(NAME SOURCES file... LINK target...)
function(vantage_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} vantage_warnings)
  target_compile_definitions(${name} PRIVATE VANTAGE_VERSION="${PROJECT_VERSION}")
  install(TARGETS ${name} RUNTIME DESTINATION bin)
endfunction()

# vantage_test(NAME SOURCES file... LINK target...): a GoogleTest program, each of its tests known to ctest.
function(vantage_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;LINK" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} vantage_warnings GTest::gtest_main)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST PROPERTIES TIMEOUT ${ARG_TIMEOUT})
endfunction()

# vantage_vm_test(NAME COMMAND argument... [OPTIONS option...]): a test inside the virtual machine of scripts/vm-test, whose
# options those are. Counted as skipped where no machine can be had. The time-out leaves room for building its kernel.
# Programs with sanitizers do not start in User-mode Linux, so that they get the slow machine.
function(vantage_vm_test name)
  cmake_parse_arguments(ARG "" "" "COMMAND;OPTIONS" ${ARGN})
  if(VANTAGE_SANITIZE)
    list(APPEND ARG_OPTIONS -e tcg)
  endif()
  add_test(NAME ${name} COMMAND ${PROJECT_SOURCE_DIR}/scripts/vm-test ${ARG_OPTIONS} -- ${ARG_COMMAND})
  set_tests_properties(${name} PROPERTIES SKIP_RETURN_CODE 125 TIMEOUT 900 LABELS vm)
endfunction()

# vantage_benchmark(NAME SOURCES file... LINK target...): run by scripts/bench, never by ctest.
function(vantage_benchmark name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} vantage_warnings benchmark::benchmark)
endfunction()

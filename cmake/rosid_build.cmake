# Compiler settings and the helpers every folder uses to declare its targets.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER AND NOT ROSID_TIDY)
  # Precompiled headers need the sloppiness; see the ccache manual, "Precompiled headers".
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
endif()

if(ROSID_TIDY)
  include(rosid_tidy)
endif()

add_library(rosid_flags INTERFACE)
target_include_directories(rosid_flags INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(rosid_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wdouble-promotion -Wold-style-cast -Wcast-align
  -Wimplicit-fallthrough -Wformat=2 -Wnon-virtual-dtor -Woverloaded-virtual -Wvla -Wundef
  $<$<CXX_COMPILER_ID:GNU>:-Wduplicated-cond;-Wlogical-op;-Wno-maybe-uninitialized;-fpch-preprocess>
  # At -O2 g++ 12 sees accesses out of bounds in std::string's operator+ and in Eigen's iterators where there are none.
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<CONFIG:RelWithDebInfo>>:-Wno-array-bounds;-Wno-stringop-overflow;-Wno-restrict>
  # Bit-exact results: no contraction of a*b+c that would depend on the target.
  -ffp-contract=off -fno-math-errno
  # -fPIE everywhere, libraries too: all targets then share one precompiled header.
  -fPIE -fstack-protector-strong)
target_link_options(rosid_flags INTERFACE -pie -Wl,-z,relro,-z,now)
if(ROSID_WARNINGS_AS_ERRORS)
  target_compile_options(rosid_flags INTERFACE -Werror)
endif()
if(ROSID_SANITIZE STREQUAL "address" OR ROSID_SANITIZE STREQUAL "fuzzer")
  target_compile_options(rosid_flags INTERFACE -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(rosid_flags INTERFACE -fsanitize=address,undefined)
  if(ROSID_SANITIZE STREQUAL "fuzzer")
    # Only the coverage counters here; the driver with main() is linked by rosid_add_fuzzer alone.
    target_compile_options(rosid_flags INTERFACE -fsanitize=fuzzer-no-link)
    target_link_options(rosid_flags INTERFACE -fsanitize=fuzzer-no-link)
  endif()
elseif(ROSID_SANITIZE STREQUAL "thread")
  # -Wno-tsan: g++ warns that ThreadSanitizer does not model fences; Boost's queue does not rely on them.
  target_compile_options(rosid_flags INTERFACE -fsanitize=thread -fno-omit-frame-pointer
    $<$<CXX_COMPILER_ID:GNU>:-Wno-tsan>)
  target_link_options(rosid_flags INTERFACE -fsanitize=thread)
elseif(ROSID_SANITIZE)
  message(FATAL_ERROR "ROSID_SANITIZE is '${ROSID_SANITIZE}': use address, thread, fuzzer or nothing")
endif()
if(ROSID_COVERAGE)
  target_compile_options(rosid_flags INTERFACE --coverage -fprofile-update=atomic)
  target_link_options(rosid_flags INTERFACE --coverage)
endif()

# Two precompiled headers: one for everything, one with GoogleTest on top for the tests.
set(heavy_headers <Eigen/Dense> <algorithm> <array> <chrono> <cmath> <cstdint> <functional> <memory> <optional> <span>
  <string> <vector>)

function(_rosid_add_pch name)
  cmake_parse_arguments(ARG "" "" "HEADERS;DEPENDS" ${ARGN})
  # Written once: a newer file would be compiled again.
  if(NOT EXISTS ${CMAKE_BINARY_DIR}/${name}.cpp)
    file(WRITE ${CMAKE_BINARY_DIR}/${name}.cpp "")
  endif()
  add_library(${name} OBJECT ${CMAKE_BINARY_DIR}/${name}.cpp)
  target_link_libraries(${name} PRIVATE rosid_flags Eigen3::Eigen ${ARG_DEPENDS})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
endfunction()

if(ROSID_PCH)
  _rosid_add_pch(rosid_pch HEADERS ${heavy_headers})
  if(ROSID_BUILD_TESTS)
    _rosid_add_pch(rosid_test_pch HEADERS ${heavy_headers} <gmock/gmock.h> <gtest/gtest.h> DEPENDS GTest::gtest GTest::gmock)
  endif()
endif()

function(_rosid_precompile target pch)
  if(ROSID_PCH)
    target_link_libraries(${target} PRIVATE Eigen3::Eigen)
    target_precompile_headers(${target} REUSE_FROM ${pch})
  endif()
endfunction()

# rosid_add_library(NAME SOURCES ... [DEPENDS ...] [PRIVATE_DEPENDS ...]): static library rosid_NAME, alias rosid::NAME.
function(rosid_add_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  add_library(rosid_${name} STATIC ${ARG_SOURCES})
  add_library(rosid::${name} ALIAS rosid_${name})
  target_link_libraries(rosid_${name} PUBLIC rosid_flags ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS})
  _rosid_precompile(rosid_${name} rosid_pch)
endfunction()

# rosid_add_executable(NAME SOURCES ... DEPENDS ...)
function(rosid_add_executable name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE rosid_flags ${ARG_DEPENDS})
  _rosid_precompile(${name} rosid_pch)
endfunction()

# rosid_add_test(NAME SOURCES ... DEPENDS ... [LABEL unit]): one GoogleTest program, registered as one ctest.
function(rosid_add_test name)
  cmake_parse_arguments(ARG "" "LABEL;TIMEOUT" "SOURCES;DEPENDS" ${ARGN})
  if(NOT ARG_LABEL)
    set(ARG_LABEL unit)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE rosid_flags ${ARG_DEPENDS} GTest::gtest_main GTest::gmock)
  _rosid_precompile(${name} rosid_test_pch)
  add_test(NAME ${name} COMMAND ${name})
  # rapidcheck takes another seed each time unless told; by hand it still does.
  set_tests_properties(${name} PROPERTIES LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT} ENVIRONMENT "RC_PARAMS=seed=1")
endfunction()

# rosid_add_fuzzer(NAME SOURCES ... DEPENDS ... [CORPUS dir] [SECONDS n]): one libFuzzer program (the fuzz preset). Its
# ctest starts from the files in CORPUS (relative to the caller's folder, never written to) and runs SECONDS, 20 by
# default; inputs it finds interesting go to the build folder. The target 'fuzzers' builds all of them.
function(rosid_add_fuzzer name)
  cmake_parse_arguments(ARG "" "CORPUS;SECONDS" "SOURCES;DEPENDS" ${ARGN})
  if(NOT ROSID_SANITIZE STREQUAL "fuzzer" OR NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "Fuzz targets need clang and ROSID_SANITIZE=fuzzer; use the preset 'fuzz'")
  endif()
  if(NOT ARG_SECONDS)
    set(ARG_SECONDS 20)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE rosid_flags ${ARG_DEPENDS})
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  add_dependencies(fuzzers ${name})
  _rosid_precompile(${name} rosid_pch)
  set(found ${CMAKE_CURRENT_BINARY_DIR}/${name}.found)
  file(MAKE_DIRECTORY ${found})
  set(corpus "")
  if(ARG_CORPUS)
    set(corpus ${CMAKE_CURRENT_SOURCE_DIR}/${ARG_CORPUS})
  endif()
  math(EXPR timeout "${ARG_SECONDS} + 60")
  add_test(NAME ${name} COMMAND ${name} -max_total_time=${ARG_SECONDS} -timeout=10 -rss_limit_mb=2048
    -artifact_prefix=${CMAKE_CURRENT_BINARY_DIR}/${name}. ${found} ${corpus})
  set_tests_properties(${name} PROPERTIES LABELS fuzz TIMEOUT ${timeout})
endfunction()

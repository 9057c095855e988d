# The preset 'tidy': clang-tidy-19 in the place of the compiler, nothing is compiled or linked. Ninja checks again only
# what changed.
#
# With the headers of clang 19 there (libclang-19-dev, llvm-19-dev) a small plugin keeps the checks out of system
# headers: one second a file instead of twenty, the same findings.

if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  message(FATAL_ERROR "ROSID_TIDY needs clang; use the preset 'tidy'")
endif()
find_program(ROSID_CLANG_TIDY clang-tidy-19 REQUIRED)
set(plugin ${CMAKE_BINARY_DIR}/rosid_tidy_scope.so)
set(CMAKE_CXX_COMPILER_LAUNCHER ${PROJECT_SOURCE_DIR}/cmake/tidy/check_source.sh ${plugin} ${CMAKE_BINARY_DIR})
set(CMAKE_CXX_CREATE_STATIC_LIBRARY "${CMAKE_COMMAND} -E touch <TARGET>")
set(CMAKE_CXX_LINK_EXECUTABLE "${CMAKE_COMMAND} -E touch <TARGET>")

find_path(ROSID_CLANG_INCLUDE_DIR clang/Frontend/FrontendPluginRegistry.h PATHS /usr/lib/llvm-19/include NO_DEFAULT_PATH)
find_path(ROSID_LLVM_INCLUDE_DIR llvm/ADT/StringRef.h PATHS /usr/lib/llvm-19/include NO_DEFAULT_PATH)
set(plugin_source ${PROJECT_SOURCE_DIR}/cmake/tidy/scope_plugin.cpp)
set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${plugin_source})
if(NOT ROSID_CLANG_INCLUDE_DIR OR NOT ROSID_LLVM_INCLUDE_DIR)
  message(STATUS "clang-tidy: libclang-19-dev or llvm-19-dev is missing, checking will be slow")
  return()
endif()
if(${plugin_source} IS_NEWER_THAN ${plugin})
  # As a command and not a target: the file is needed before the first source is checked.
  execute_process(
    COMMAND ${CMAKE_CXX_COMPILER} -std=c++17 -O1 -fPIC -shared -fno-rtti -isystem ${ROSID_CLANG_INCLUDE_DIR} ${plugin_source}
      -o ${plugin}
    COMMAND_ERROR_IS_FATAL ANY)
endif()

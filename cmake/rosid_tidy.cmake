# clang-tidy-19 beside every compilation (the preset 'tidy'). Ninja then checks again only what changed.
#
# With the headers of clang 19 there (libclang-19-dev, llvm-19-dev) a small plugin keeps the checks out of system
# headers: one second a file instead of twenty, the same findings.

find_program(ROSID_CLANG_TIDY clang-tidy-19 REQUIRED)
set(CMAKE_CXX_CLANG_TIDY ${ROSID_CLANG_TIDY} --quiet)

find_path(ROSID_CLANG_INCLUDE_DIR clang/Frontend/FrontendPluginRegistry.h PATHS /usr/lib/llvm-19/include NO_DEFAULT_PATH)
find_path(ROSID_LLVM_INCLUDE_DIR llvm/ADT/StringRef.h PATHS /usr/lib/llvm-19/include NO_DEFAULT_PATH)
set(plugin_source ${PROJECT_SOURCE_DIR}/cmake/tidy/scope_plugin.cpp)
set(plugin ${CMAKE_BINARY_DIR}/rosid_tidy_scope.so)
set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${plugin_source})
if(NOT ROSID_CLANG_INCLUDE_DIR OR NOT ROSID_LLVM_INCLUDE_DIR)
  message(STATUS "clang-tidy: libclang-19-dev or llvm-19-dev is missing, checking will be slow")
  return()
endif()
if(${plugin_source} IS_NEWER_THAN ${plugin})
  # As a command and not a target: CMAKE_CXX_CLANG_TIDY needs the file before the first target is compiled.
  execute_process(
    COMMAND ${CMAKE_CXX_COMPILER} -std=c++17 -O1 -fPIC -shared -fno-rtti -isystem ${ROSID_CLANG_INCLUDE_DIR} ${plugin_source}
      -o ${plugin}
    COMMAND_ERROR_IS_FATAL ANY)
endif()
list(APPEND CMAKE_CXX_CLANG_TIDY --load=${plugin})

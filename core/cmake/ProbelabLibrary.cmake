# SPDX-License-Identifier: Apache-2.0
# One static library a folder. A library exports only its own include folder and links only what
# is named here, so an include against the dependency direction (ARCHITECTURE.md) does not compile.
# Every public header is also compiled with nothing before it.
#
#   probelab_library(scene SOURCES a.cpp b.cpp LINKS base PRIVATE_LINKS tinygltf)
function(probelab_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS;PRIVATE_LINKS" ${ARGN})
  set(target probelab_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  target_include_directories(${target} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/include)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
                                           -Wno-sign-conversion -Werror=return-type)
  foreach(link IN LISTS ARG_LINKS)
    target_link_libraries(${target} PUBLIC probelab_${link})
  endforeach()
  target_link_libraries(${target} PRIVATE ${ARG_PRIVATE_LINKS})
  probelab_check_headers(${target} ${CMAKE_CURRENT_SOURCE_DIR}/include)
endfunction()

# Every header under `root` has to compile with nothing before it. A source of the target that
# includes it first shows that already; any other header gets a translation unit of its own, as part
# of the tests' build.
function(probelab_check_headers target root)
  if(NOT PROBELAB_BUILD_TESTS)
    return()
  endif()
  get_target_property(sources ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  set(shown)
  foreach(source IN LISTS sources)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
    if(EXISTS ${source})
      file(STRINGS ${source} first REGEX "^#include" LIMIT_COUNT 1)
      string(REGEX REPLACE "^#include \"(.*)\".*" "\\1" first "${first}")
      list(APPEND shown "${first}")
    endif()
  endforeach()
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${root} ${root}/*.h)
  set(units)
  list(REMOVE_ITEM headers ${shown})
  foreach(header IN LISTS headers)
    string(MAKE_C_IDENTIFIER ${header} id)
    set(unit ${CMAKE_CURRENT_BINARY_DIR}/alone_${id}.cpp)
    file(CONFIGURE OUTPUT ${unit} CONTENT "#include \"${header}\"\n#include \"${header}\"\n")
    list(APPEND units ${unit})
  endforeach()
  if(units)
    add_library(${target}_headers OBJECT ${units})
    set_target_properties(${target}_headers PROPERTIES UNITY_BUILD OFF)
    target_link_libraries(${target}_headers PRIVATE ${target})
  endif()
endfunction()

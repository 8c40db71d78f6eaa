# SPDX-License-Identifier: Apache-2.0
# Text files built into a library, so that the program finds them from anywhere. Writes a source file
# that defines `std::span<const EmbeddedFile> FUNCTION()` for every file of a folder of the caller's
# with one of the extensions, under its name without extension, and sets OUTPUT to its path.
#
#   probelab_embed(preset_source presets presetFiles ddgi/preset_files.h toml)
function(probelab_embed output folder function header)
  set(files)
  foreach(extension IN LISTS ARGN)
    file(GLOB found CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.${extension})
    list(APPEND files ${found})
  endforeach()
  set(entries)
  foreach(file IN LISTS files)
    get_filename_component(stem ${file} NAME_WE)
    file(READ ${file} text)
    string(APPEND entries "    {\"${stem}\", R\"embedded(${text})embedded\"},\n")
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  endforeach()
  set(source ${CMAKE_CURRENT_BINARY_DIR}/embedded_${folder}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT
"#include \"${header}\"

namespace probelab {

std::span<const EmbeddedFile> ${function}() {
  static const EmbeddedFile files[] = {
${entries}  };
  return files;
}

}  // namespace probelab
" @ONLY)
  set(${output} ${source} PARENT_SCOPE)
endfunction()

# SPDX-License-Identifier: Apache-2.0
# Writes OUTPUT, a header with the version of the sources in SOURCE: VERSION, and of a git checkout
# its commit and, where what is compiled differs from that, a hash of how, with files that git does
# not track. Every build runs this; a header that would say the same stays untouched, so that nothing
# is compiled again.
set(version ${VERSION})
if(GIT)
  execute_process(COMMAND ${GIT} -C ${SOURCE} describe --always
                  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(commit)
    string(APPEND version "+${commit}")
    set(compiled -- CMakeLists.txt core placement experiments :!experiments/studies)
    execute_process(COMMAND ${GIT} -C ${SOURCE} diff HEAD ${compiled}
                    OUTPUT_VARIABLE changes ERROR_QUIET)
    execute_process(COMMAND ${GIT} -C ${SOURCE} ls-files --others --exclude-standard ${compiled}
                    OUTPUT_VARIABLE untracked ERROR_QUIET)
    string(REGEX MATCHALL "[^\n]+" untracked "${untracked}")
    foreach(name IN LISTS untracked)
      if(EXISTS ${SOURCE}/${name})
        file(SHA256 ${SOURCE}/${name} hash)
        string(APPEND changes "${name} ${hash}\n")
      endif()
    endforeach()
    if(changes)
      string(SHA256 hash "${changes}")
      string(SUBSTRING ${hash} 0 8 hash)
      string(APPEND version "-dirty.${hash}")
    endif()
  endif()
endif()
set(text "#define PROBELAB_VERSION \"${version}\"\n")
set(before "")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} before)
endif()
if(NOT before STREQUAL text)
  file(WRITE ${OUTPUT} "${text}")
endif()

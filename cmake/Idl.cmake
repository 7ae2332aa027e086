# omnifleet_idl_library(NAME FILES a.idl b.idl …): library of the types that fastddsgen generates at build time. They are
# never committed.
#   "idl/<file>.h" and "idl/<file>PubSubTypes.h": generated headers (system includes, so that they raise no warnings)
#   "idl/hashes.h": one `inline constexpr char k<File>Hash[]` per file, the SHA-256 of its text with its includes
# A change of a file regenerates this file and the files that include it.
find_program(FASTDDSGEN fastddsgen REQUIRED)
find_package(fastcdr REQUIRED)
find_package(fastrtps REQUIRED)

# Returns all files that FILE includes, directly or indirectly.
function(omnifleet_idl_includes file result)
  file(STRINGS ${file} lines REGEX "^#include \"")
  set(found)
  foreach(line IN LISTS lines)
    string(REGEX REPLACE "^#include \"([^\"]+)\".*" "\\1" included "${line}")
    get_filename_component(folder ${file} DIRECTORY)
    omnifleet_idl_includes(${folder}/${included} nested)
    list(APPEND found ${folder}/${included} ${nested})
  endforeach()
  list(REMOVE_DUPLICATES found)
  set(${result} ${found} PARENT_SCOPE)
endfunction()

function(omnifleet_idl_library name)
  cmake_parse_arguments(ARG "" "" "FILES" ${ARGN})
  set(root ${CMAKE_BINARY_DIR}/generated)
  set(out ${root}/idl)
  file(MAKE_DIRECTORY ${out})
  set(sources)
  set(idls)
  foreach(file IN LISTS ARG_FILES)
    get_filename_component(base ${file} NAME_WE)
    set(idl ${CMAKE_CURRENT_SOURCE_DIR}/${file})
    omnifleet_idl_includes(${idl} includes)
    set(scratch ${CMAKE_CURRENT_BINARY_DIR}/${base})
    set(names ${base}.h ${base}.cxx ${base}PubSubTypes.h ${base}PubSubTypes.cxx)
    list(TRANSFORM names PREPEND ${out}/ OUTPUT_VARIABLE generated)
    list(TRANSFORM names PREPEND ${scratch}/ OUTPUT_VARIABLE written)
    # One folder per file: fastddsgen also writes the files of the includes, so parallel runs would write the same
    # files. -cs: names are case sensitive (a member `header` of type `Header`). No type objects: other vendors reject
    # them.
    add_custom_command(OUTPUT ${generated}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${scratch}
      COMMAND ${FASTDDSGEN} -replace -cs -I ${CMAKE_CURRENT_SOURCE_DIR} -d ${scratch} ${idl} > ${scratch}/log
      COMMAND ${CMAKE_COMMAND} -E copy ${written} ${out}
      DEPENDS ${idl} ${includes}
      COMMENT "fastddsgen ${file}" VERBATIM)
    list(APPEND sources ${generated})
    list(APPEND idls ${idl})
  endforeach()

  set(script ${CMAKE_SOURCE_DIR}/cmake/IdlHashes.cmake)
  string(REPLACE ";" "," idl_list "${idls}")
  add_custom_command(OUTPUT ${out}/hashes.h
    COMMAND ${CMAKE_COMMAND} -DIDLS=${idl_list} -DOUTPUT=${out}/hashes.h -P ${script}
    DEPENDS ${idls} ${script} COMMENT "IDL hashes" VERBATIM)

  add_library(${name} STATIC ${sources} ${out}/hashes.h)
  target_include_directories(${name} SYSTEM PUBLIC ${root})
  target_link_libraries(${name} PUBLIC fastrtps fastcdr)
  target_compile_options(${name} PRIVATE -w)
  if(OMNIFLEET_SANITIZE)
    target_compile_options(${name} PRIVATE -fsanitize=${OMNIFLEET_SANITIZE} -fno-omit-frame-pointer)
  endif()
endfunction()

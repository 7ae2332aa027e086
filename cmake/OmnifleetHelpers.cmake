# The only ways to add a target: one helper for libraries, one for services, one for tests.
include(CMakeParseArguments)

add_library(omnifleet_flags INTERFACE)
target_compile_options(omnifleet_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Werror -Wno-psabi)
if(OMNIFLEET_SANITIZE)
  # GCC 12 sees uninitialised members of std::regex where a sanitizer has changed the flow.
  target_compile_options(omnifleet_flags INTERFACE -fsanitize=${OMNIFLEET_SANITIZE} -fno-omit-frame-pointer
    -Wno-maybe-uninitialized)
  target_link_options(omnifleet_flags INTERFACE -fsanitize=${OMNIFLEET_SANITIZE})
endif()

# Sources that run once, or only call what is measured elsewhere: command lines, cases of tests. CLI11 and GoogleTest
# are templates throughout; optimised as a hot path is, they take a third longer to compile.
function(omnifleet_run_once)
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release>:-O1>")
endfunction()

# omnifleet_library(NAME SOURCES … PUBLIC targets… PRIVATE targets…)
# One folder, one target, named omnifleet_NAME; headers are included as "NAME/header.h".
function(omnifleet_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  if(ARG_SOURCES)
    add_library(omnifleet_${name} STATIC ${ARG_SOURCES})
    target_include_directories(omnifleet_${name} PUBLIC ${CMAKE_SOURCE_DIR}/libs)
    target_link_libraries(omnifleet_${name} PUBLIC ${ARG_PUBLIC} PRIVATE omnifleet_flags ${ARG_PRIVATE})
  else()
    add_library(omnifleet_${name} INTERFACE)
    target_include_directories(omnifleet_${name} INTERFACE ${CMAKE_SOURCE_DIR}/libs)
    target_link_libraries(omnifleet_${name} INTERFACE ${ARG_PUBLIC})
  endif()
endfunction()

# omnifleet_test(NAME SOURCES … LIBS targets… [LABELS …] [TIMEOUT s]): a GoogleTest binary, one ctest entry per case.
function(omnifleet_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;LIBS;LABELS" ${ARGN})
  if(NOT OMNIFLEET_BUILD_TESTS)
    return()
  endif()
  include(GoogleTest)
  add_executable(${name} ${ARG_SOURCES})
  set(cases ${ARG_SOURCES})
  list(FILTER cases INCLUDE REGEX "_test\\.cpp$")
  omnifleet_run_once(${cases})
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR} ${CMAKE_SOURCE_DIR}/services)
  target_link_libraries(${name} PRIVATE omnifleet_flags ${ARG_LIBS} GTest::gmock GTest::gtest GTest::gtest_main)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 60)
  endif()
  if(NOT ARG_LABELS)
    set(ARG_LABELS unit)
  endif()
  # Whole fleets look at the host's shared memory and want its cores: one at a time.
  set(serial)
  if(NOT ARG_LABELS STREQUAL "unit")
    set(serial RUN_SERIAL TRUE)
  endif()
  gtest_discover_tests(${name} TEST_PREFIX "${name}." DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 120 NO_PRETTY_VALUES
    PROPERTIES ${serial} TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}"
      ENVIRONMENT "OMNIFLEET_SOURCE_DIR=${CMAKE_SOURCE_DIR};OMNIFLEET_BINARY_DIR=${CMAKE_BINARY_DIR}")
endfunction()

# The only ways to add a target: one helper for libraries, one for services, one for tests.
include(CMakeParseArguments)

add_library(omnifleet_flags INTERFACE)
target_compile_options(omnifleet_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Werror -Wno-psabi)
# Square roots set no errno and comparisons raise no traps that anyone reads: else they are no vector operations. No
# product is fused with a sum: the same bits on every processor (geometry/wide.h).
target_compile_options(omnifleet_flags INTERFACE -fno-math-errno -fno-trapping-math -ffp-contract=off)
if(OMNIFLEET_SANITIZE)
  # GCC 12 sees uninitialised members of std::regex where a sanitizer has changed the flow.
  target_compile_options(omnifleet_flags INTERFACE -fsanitize=${OMNIFLEET_SANITIZE} -fno-omit-frame-pointer
    -Wno-maybe-uninitialized)
  target_link_options(omnifleet_flags INTERFACE -fsanitize=${OMNIFLEET_SANITIZE})
endif()

# Sources that run once: command lines. CLI11 is templates throughout; optimised as a hot path is, it takes a third
# longer to compile.
function(omnifleet_run_once)
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release>:-O1>")
endfunction()

# Headers are read once: more than half of a build from nothing went into reading them. Every file still includes
# what it uses: the debug preset precompiles nothing, and would tell.
option(OMNIFLEET_PRECOMPILE "Compile what many files include once" ON)
set(OMNIFLEET_HEADERS <Eigen/Dense> <opencv2/core.hpp> <algorithm> <array> <chrono> <cmath> <filesystem> <functional>
  <map> <memory> <optional> <set> <string> <variant> <vector>)

# omnifleet_precompiled(NAME HEADERS … LIBS targets…)
function(omnifleet_precompiled name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LIBS" ${ARGN})
  if(NOT OMNIFLEET_PRECOMPILE)
    return()
  endif()
  set(source ${CMAKE_BINARY_DIR}/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "// Compiles the headers that it is given.\n")
  add_library(omnifleet_${name} OBJECT ${source})
  target_precompile_headers(omnifleet_${name} PRIVATE ${ARG_HEADERS})
  target_link_libraries(omnifleet_${name} PRIVATE omnifleet_flags ${ARG_LIBS})
endfunction()

# omnifleet_reads_precompiled(NAME targets…): only for targets with the same compiler options.
function(omnifleet_reads_precompiled name)
  if(NOT OMNIFLEET_PRECOMPILE)
    return()
  endif()
  foreach(target IN LISTS ARGN)
    target_precompile_headers(${target} REUSE_FROM omnifleet_${name})
  endforeach()
endfunction()

# omnifleet_unites(targets…): their sources are compiled several at a time. What these read (DDS types, fmt,
# GoogleTest) and the templates that each of them makes of it cost more than the sources themselves: half of a
# build from nothing. Names in their anonymous namespaces must differ within a target. Not for the hot paths, which
# are quick to compile and are optimised file by file.
set(OMNIFLEET_UNITED 6)
function(omnifleet_unites)
  if(NOT OMNIFLEET_PRECOMPILE)
    return()
  endif()
  set_target_properties(${ARGN} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${OMNIFLEET_UNITED})
endfunction()

# omnifleet_library(NAME SOURCES … PUBLIC targets… PRIVATE targets…)
# One folder, one target, named omnifleet_NAME; headers are included as "NAME/header.h".
function(omnifleet_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  if(ARG_SOURCES)
    add_library(omnifleet_${name} STATIC ${ARG_SOURCES})
    target_include_directories(omnifleet_${name} PUBLIC ${CMAKE_SOURCE_DIR}/libs)
    target_link_libraries(omnifleet_${name} PUBLIC ${ARG_PUBLIC} PRIVATE omnifleet_flags ${ARG_PRIVATE})
    omnifleet_reads_precompiled(headers omnifleet_${name})
  else()
    add_library(omnifleet_${name} INTERFACE)
    target_include_directories(omnifleet_${name} INTERFACE ${CMAKE_SOURCE_DIR}/libs)
    target_link_libraries(omnifleet_${name} INTERFACE ${ARG_PUBLIC})
  endif()
endfunction()

# omnifleet_test(NAME SOURCES … LIBS targets… [LABELS …] [TIMEOUT s] [APART]): a GoogleTest binary, one ctest entry per
# case. APART: its sources use the same names, so each is compiled for itself.
function(omnifleet_test name)
  cmake_parse_arguments(ARG "APART" "TIMEOUT" "SOURCES;LIBS;LABELS" ${ARGN})
  if(NOT OMNIFLEET_BUILD_TESTS)
    return()
  endif()
  include(GoogleTest)
  add_executable(${name} ${ARG_SOURCES})
  if(NOT ARG_APART)
    omnifleet_unites(${name})
  endif()
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR} ${CMAKE_SOURCE_DIR}/services)
  target_link_libraries(${name} PRIVATE omnifleet_flags ${ARG_LIBS} GTest::gmock GTest::gtest GTest::gtest_main)
  omnifleet_reads_precompiled(test_headers ${name})
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

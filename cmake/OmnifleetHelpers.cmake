# Helpers that add targets: one for libraries and one for tests. services/CMakeLists.txt has one for programs.
include(CMakeParseArguments)

add_library(omnifleet_flags INTERFACE)
target_compile_options(omnifleet_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Werror -Wno-psabi)
# Square roots set no errno and comparisons raise no traps. Otherwise the compiler could not vectorise them. No fused
# multiply-add: results are equal bit by bit on every processor (geometry/wide.h).
target_compile_options(omnifleet_flags INTERFACE -fno-math-errno -fno-trapping-math -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # The compiler collects its garbage only from 512 MB on, not from 128 MB: a tenth less time for a full build.
  target_compile_options(omnifleet_flags INTERFACE --param=ggc-min-heapsize=524288)
endif()
if(OMNIFLEET_SANITIZE)
  # With sanitizers GCC 12 wrongly reports uninitialised members of std::regex.
  target_compile_options(omnifleet_flags INTERFACE -fsanitize=${OMNIFLEET_SANITIZE} -fno-omit-frame-pointer
    -Wno-maybe-uninitialized)
  target_link_options(omnifleet_flags INTERFACE -fsanitize=${OMNIFLEET_SANITIZE})
  # Under AddressSanitizer, Eigen aligns memory itself. The static library of Ceres was built without it and uses malloc;
  # the linker takes Eigen's functions from either, so memory of the one was freed by the other.
  target_compile_definitions(omnifleet_flags INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()

# omnifleet_run_once(sources…): sources that run once, as the parsing of a command line. They are compiled with -O1: with
# full optimisation the templates of CLI11 take a third longer to compile.
function(omnifleet_run_once)
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release>:-O1>")
endfunction()

# Precompiled headers: reading headers took more than half of a full build. Every file still includes what it uses. The
# debug preset precompiles nothing, so it detects a missing include.
option(OMNIFLEET_PRECOMPILE "Precompile the headers that many files include, and compile several sources at a time" ON)
set(OMNIFLEET_HEADERS <Eigen/Dense> <opencv2/core.hpp> <algorithm> <array> <chrono> <cmath> <filesystem> <functional>
  <map> <memory> <optional> <set> <string> <variant> <vector>)

# omnifleet_precompiled(NAME HEADERS … LIBS targets…): precompiles these headers under the name NAME.
function(omnifleet_precompiled name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LIBS" ${ARGN})
  if(NOT OMNIFLEET_PRECOMPILE)
    return()
  endif()
  set(source ${CMAKE_BINARY_DIR}/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "// Carries the precompiled headers.\n")
  add_library(omnifleet_${name} OBJECT ${source})
  target_precompile_headers(omnifleet_${name} PRIVATE ${ARG_HEADERS})
  target_link_libraries(omnifleet_${name} PRIVATE omnifleet_flags ${ARG_LIBS})
endfunction()

# omnifleet_reads_precompiled(NAME targets…): the targets use the precompiled headers NAME. Their compiler options must be
# the same.
function(omnifleet_reads_precompiled name)
  if(NOT OMNIFLEET_PRECOMPILE)
    return()
  endif()
  foreach(target IN LISTS ARGN)
    target_precompile_headers(${target} REUSE_FROM omnifleet_${name})
  endforeach()
endfunction()

# omnifleet_unites(targets…): compiles several sources of a target at a time (unity build). The headers of such sources
# (DDS types, fmt, GoogleTest) and their template instances cost more time than the sources: half of a full build. Names
# in anonymous namespaces must be unique within a target. Do not use it for hot paths: they compile quickly and are
# optimised file by file.
set(OMNIFLEET_UNITED 6)
function(omnifleet_unites)
  if(NOT OMNIFLEET_PRECOMPILE)
    return()
  endif()
  set_target_properties(${ARGN} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${OMNIFLEET_UNITED})
endfunction()

# omnifleet_library(NAME SOURCES … PUBLIC targets… PRIVATE targets…): one target omnifleet_NAME per folder. Its headers are
# included as "NAME/header.h".
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

# omnifleet_test(NAME SOURCES … LIBS targets… [LABELS …] [TIMEOUT s] [FILTER pattern] [APART] [BESIDE_OTHERS]): a GoogleTest
# program with one ctest entry per case. FILTER: only these cases. APART: compiles each source separately, because sources
# use the same names. BESIDE_OTHERS: processes in lockstep, which may run beside other tests.
function(omnifleet_test name)
  cmake_parse_arguments(ARG "APART;BESIDE_OTHERS" "TIMEOUT;FILTER" "SOURCES;LIBS;LABELS" ${ARGN})
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
  # Tests of whole fleets need the cores of the host, so they run one at a time.
  set(serial)
  if(NOT ARG_LABELS STREQUAL "unit" AND NOT ARG_BESIDE_OTHERS)
    set(serial RUN_SERIAL TRUE)
  endif()
  set(filter)
  if(ARG_FILTER)
    set(filter TEST_FILTER ${ARG_FILTER})
  endif()
  gtest_discover_tests(${name} ${filter} TEST_PREFIX "${name}." DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 120 NO_PRETTY_VALUES
    PROPERTIES ${serial} TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}"
      ENVIRONMENT "OMNIFLEET_SOURCE_DIR=${CMAKE_SOURCE_DIR};OMNIFLEET_BINARY_DIR=${CMAKE_BINARY_DIR}")
endfunction()

# Compiler flags for phyxel's own targets, and the one way to add a test.

set(PHYXEL_SANITIZE "" CACHE STRING "Sanitizers, e.g. address,undefined or thread")

# Semantic versioning: before 1.0 a minor version may break what used the one before, after that only
# a major version may.
if(PROJECT_VERSION_MAJOR EQUAL 0)
  set(PHYXEL_COMPATIBILITY SameMinorVersion)
  set(PHYXEL_SOVERSION 0.${PROJECT_VERSION_MINOR})
else()
  set(PHYXEL_COMPATIBILITY SameMajorVersion)
  set(PHYXEL_SOVERSION ${PROJECT_VERSION_MAJOR})
endif()

add_library(phyxel_flags INTERFACE)
target_compile_options(phyxel_flags INTERFACE
  "$<$<COMPILE_LANGUAGE:CXX>:-Wall;-Wextra;-Wpedantic;-Wshadow;-Wconversion;-Wno-sign-conversion>"
  # Designated initialisers name what matters; the rest has defaults.
  "$<$<COMPILE_LANGUAGE:CXX>:-Wno-missing-field-initializers>"
  # GCC 12 sees copies that overlap and members that are not set inside std::string and std::vector.
  "$<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-restrict;-Wno-maybe-uninitialized>"
  # SIMD packs never cross a library border.
  "$<$<COMPILE_LANGUAGE:CXX>:-Wno-psabi>"
  # clang does not know GCC's unrolling pragma, and tells of loops that sanitizers keep scalar.
  "$<$<COMPILE_LANG_AND_ID:CXX,Clang,AppleClang>:-Wno-unknown-pragmas;-Wno-pass-failed>")
# The asan preset names the checks of undefined behaviour that find what address checks do not. Those of pointers, which
# clang puts at every access to a member, made the solver's kernels compile six times as long: null and stray pointers
# end a program under the address sanitizer anyway.
if(PHYXEL_SANITIZE)
  target_compile_options(phyxel_flags INTERFACE
    "$<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${PHYXEL_SANITIZE};-fno-omit-frame-pointer;-fno-sanitize-recover=all>")
  target_link_options(phyxel_flags INTERFACE -fsanitize=${PHYXEL_SANITIZE})
endif()

# phyxel_precompile(target header...), phyxel_precompile(target REUSE_FROM target): headers that most sources of a target
# read, precompiled with PHYXEL_PCH. Builds without it keep each source's own list of includes honest, and share objects
# through ccache, which takes a precompiled header of another folder for another compilation.
function(phyxel_precompile target)
  if(NOT PHYXEL_PCH)
    return()
  endif()
  if(ARGV1 STREQUAL "REUSE_FROM")
    target_precompile_headers(${target} REUSE_FROM ${ARGV2})
  else()
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")  # ccache could not tell one header's times from a change
    target_compile_options(${target} PRIVATE "SHELL:-Xclang -fno-pch-timestamp")
  endif()
endfunction()

# phyxel_library(NAME source...): an installed library beside the first one, static or shared as
# that; a source folder's headers are found from the root of the tree, and installed by nobody.
function(phyxel_library name)
  string(REPLACE phyxel_ "" export_name ${name})
  add_library(${name} ${ARGN})
  add_library(phyxel::${export_name} ALIAS ${name})
  set_target_properties(${name} PROPERTIES
    EXPORT_NAME ${export_name} POSITION_INDEPENDENT_CODE ON
    VERSION ${PROJECT_VERSION} SOVERSION ${PHYXEL_SOVERSION}
    INSTALL_RPATH $ORIGIN INSTALL_RPATH_USE_LINK_PATH ON)
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                                     PRIVATE ${PROJECT_SOURCE_DIR}/lib)
  target_link_libraries(${name} PUBLIC phyxel
                        PRIVATE $<BUILD_INTERFACE:phyxel_flags> fmt::fmt OpenMP::OpenMP_CXX)
endfunction()

# A skipped case ends with exit code 77 (tests/support/skips.hpp), and only that makes CTest say "Skipped".
set(PHYXEL_SKIP_PROPERTIES SKIP_RETURN_CODE 77)

# phyxel_one_skip(name): after gtest_discover_tests, takes its own pattern for skips out of what it has written.
function(phyxel_one_skip name)
  add_custom_command(TARGET ${name} POST_BUILD VERBATIM COMMAND ${CMAKE_COMMAND}
    -DFOLDER=${CMAKE_CURRENT_BINARY_DIR} -DNAME=${name} -P ${PROJECT_SOURCE_DIR}/cmake/PhyxelOneSkip.cmake)
endfunction()

# What a test may need of the tree: where the sources are, and the two folders of headers.
function(phyxel_configure_test name)
  target_link_libraries(${name} PRIVATE phyxel phyxel_flags)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests ${PROJECT_SOURCE_DIR}/lib)
  target_compile_definitions(${name} PRIVATE PHYXEL_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  set_target_properties(${name} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
endfunction()

# phyxel_add_test(NAME source... [LIBRARIES lib...] [LABELS label...] [TIMEOUT seconds] [PREFIX p]
# [TOGETHER filter]): a GoogleTest program with one ctest entry a case. The cases that match the filter share one entry, and
# with it their costly set-up; they must never skip, since ctest names entries, not cases.
function(phyxel_add_test name)
  cmake_parse_arguments(arg "" "TIMEOUT;PREFIX;TOGETHER" "LIBRARIES;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 900)  # sanitizers on a busy machine
  endif()
  add_executable(${name} ${arg_UNPARSED_ARGUMENTS})
  phyxel_configure_test(${name})
  target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} phyxel_test_main)
  set(properties TIMEOUT ${arg_TIMEOUT} ${PHYXEL_SKIP_PROPERTIES})
  if(arg_LABELS)
    list(JOIN arg_LABELS "_" label)  # one: a list would not get through
    list(APPEND properties LABELS ${label})
    foreach(label IN LISTS arg_LABELS)
      add_dependencies(phyxel_${label}_tests ${name})
    endforeach()
  endif()
  set(others "")
  if(arg_TOGETHER)
    add_test(NAME ${name} COMMAND ${name} --gtest_filter=${arg_TOGETHER})
    set_tests_properties(${name} PROPERTIES ${properties})
    if(arg_TOGETHER STREQUAL "*")
      return()
    endif()
    set(others TEST_FILTER "-${arg_TOGETHER}")
  endif()
  gtest_discover_tests(${name} TEST_PREFIX "${arg_PREFIX}" NO_PRETTY_VALUES DISCOVERY_TIMEOUT 60 ${others}
                       PROPERTIES ${properties})
  phyxel_one_skip(${name})
endfunction()

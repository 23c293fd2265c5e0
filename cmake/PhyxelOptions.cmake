# Compiler flags of phyxel's targets, and the function that adds a test.

set(PHYXEL_SANITIZE "" CACHE STRING "Sanitizers, e.g. address,undefined or thread")

# Semantic versioning: a minor version may break compatibility before 1.0, only a major version later.
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
  # Designated initialisers leave other members at their defaults.
  "$<$<COMPILE_LANGUAGE:CXX>:-Wno-missing-field-initializers>"
  # GCC 12 falsely reports overlapping copies and uninitialised members inside std::string and std::vector.
  "$<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-restrict;-Wno-maybe-uninitialized>"
  # SIMD packs are not passed between libraries.
  "$<$<COMPILE_LANGUAGE:CXX>:-Wno-psabi>"
  # clang does not know GCC's unrolling pragma, and reports loops that sanitizers prevent from vectorising.
  "$<$<COMPILE_LANG_AND_ID:CXX,Clang,AppleClang>:-Wno-unknown-pragmas;-Wno-pass-failed>")
# The asan preset selects the checks of undefined behaviour that complement the address sanitizer. Checks of pointers, which
# clang adds to each access to a member, would increase the compile time of the solver's kernels sixfold; the address
# sanitizer finds null and stray pointers anyway.
if(PHYXEL_SANITIZE)
  target_compile_options(phyxel_flags INTERFACE
    "$<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${PHYXEL_SANITIZE};-fno-omit-frame-pointer;-fno-sanitize-recover=all>")
  target_link_options(phyxel_flags INTERFACE -fsanitize=${PHYXEL_SANITIZE})
endif()

# phyxel_precompile(target header...), phyxel_precompile(target REUSE_FROM target): precompiles headers of a target if
# PHYXEL_PCH is ON. Builds without it check that each source includes what it uses, and share objects through ccache, for which a
# precompiled header in another folder is a different compilation.
function(phyxel_precompile target)
  if(PHYXEL_PCH AND NOT PHYXEL_PCH STREQUAL "TESTS")
    phyxel_precompile_always(${target} ${ARGN})
  endif()
endfunction()

# phyxel_precompile_always: the same, whatever PHYXEL_PCH is.
function(phyxel_precompile_always target)
  if(ARGV1 STREQUAL "REUSE_FROM")
    target_precompile_headers(${target} REUSE_FROM ${ARGV2})
  else()
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")  # otherwise ccache takes a new time stamp for a change
    target_compile_options(${target} PRIVATE "SHELL:-Xclang -fno-pch-timestamp")
  else()
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-fpch-preprocess>)
  endif()
endfunction()

# phyxel_library(NAME source...): an installed library, static or shared as phyxel itself. Its headers are included by
# paths from the root of the tree, and are not installed.
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

# Test programs, which are many, are linked by LLVM's linker if there is one: it is much the fastest.
find_program(PHYXEL_LLD ld.lld)
mark_as_advanced(PHYXEL_LLD)

# Only exit code 77 of a skipped case (tests/support/skips.hpp) makes CTest report "Skipped".
set(PHYXEL_SKIP_PROPERTIES SKIP_RETURN_CODE 77)

# phyxel_one_skip(name): removes the pattern for skips from the file that gtest_discover_tests has written.
function(phyxel_one_skip name)
  add_custom_command(TARGET ${name} POST_BUILD VERBATIM COMMAND ${CMAKE_COMMAND}
    -DFOLDER=${CMAKE_CURRENT_BINARY_DIR} -DNAME=${name} -P ${PROJECT_SOURCE_DIR}/cmake/PhyxelOneSkip.cmake)
endfunction()

# Gives a test the path of the sources and the include folders. Tests are many, and most of their time is the library's:
# they are not optimised far.
function(phyxel_configure_test name)
  target_link_libraries(${name} PRIVATE phyxel phyxel_flags)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests ${PROJECT_SOURCE_DIR}/lib)
  target_compile_definitions(${name} PRIVATE PHYXEL_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_compile_options(${name} PRIVATE $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<NOT:$<CONFIG:Debug>>>:-O1>)
  if(PHYXEL_LLD)
    target_link_options(${name} PRIVATE "$<$<LINK_LANGUAGE:CXX>:-fuse-ld=lld>")
  endif()
  set_target_properties(${name} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
endfunction()

# phyxel_add_test(NAME source... [LIBRARIES lib...] [LABELS label...] [TIMEOUT seconds] [PREFIX p]
# [TOGETHER filter]): a GoogleTest program with one ctest entry for each case. Cases that match the filter share one entry,
# and their expensive set-up; they must not skip, since ctest reports entries, not cases.
function(phyxel_add_test name)
  cmake_parse_arguments(arg "" "TIMEOUT;PREFIX;TOGETHER" "LIBRARIES;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 900)  # long enough for sanitizers on a busy machine
  endif()
  add_executable(${name} ${arg_UNPARSED_ARGUMENTS})
  phyxel_configure_test(${name})
  target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} phyxel_test_main)
  if(PHYXEL_PCH)
    target_link_libraries(${name} PRIVATE OpenMP::OpenMP_CXX)  # as the precompiled headers
    set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
    phyxel_precompile_always(${name} REUSE_FROM phyxel_test_main)
  endif()
  set(properties TIMEOUT ${arg_TIMEOUT} ${PHYXEL_SKIP_PROPERTIES})
  if(arg_LABELS)
    list(JOIN arg_LABELS "_" label)  # one label, since lists cannot be passed on
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

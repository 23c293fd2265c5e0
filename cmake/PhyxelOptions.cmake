# Compiler flags for phyxel's own targets, and the one way to add a test.

set(PHYXEL_SANITIZE "" CACHE STRING "Sanitizers, e.g. address,undefined or thread")

add_library(phyxel_flags INTERFACE)
target_compile_options(phyxel_flags INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion>)
if(PHYXEL_SANITIZE)
  target_compile_options(phyxel_flags INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${PHYXEL_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all>)
  target_link_options(phyxel_flags INTERFACE -fsanitize=${PHYXEL_SANITIZE})
endif()

# phyxel_add_test(NAME source... [LIBRARIES lib...]): a GoogleTest program, one ctest entry a case.
function(phyxel_add_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "LIBRARIES" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  add_executable(${name} ${arg_UNPARSED_ARGUMENTS})
  target_link_libraries(${name} PRIVATE phyxel phyxel_flags ${arg_LIBRARIES} GTest::gmock_main)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests ${PROJECT_SOURCE_DIR}/lib)
  set_target_properties(${name} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT ${arg_TIMEOUT})
endfunction()

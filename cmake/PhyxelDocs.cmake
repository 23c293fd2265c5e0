# Target `docs`: the API reference, if Doxygen is installed, in docs/html of the build folder. As a script
# (cmake -DDOXYGEN=... -DFOLDER=... -P PhyxelDocs.cmake) this file runs Doxygen, for the target and the test.
if(CMAKE_SCRIPT_MODE_FILE)
  cmake_minimum_required(VERSION 3.25)
  file(REMOVE_RECURSE ${FOLDER}/html)
  execute_process(COMMAND ${DOXYGEN} ${FOLDER}/Doxyfile RESULT_VARIABLE code ERROR_VARIABLE said OUTPUT_QUIET)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "exit code ${code} of ${DOXYGEN}: ${said}")
  endif()
  file(STRINGS ${FOLDER}/warnings.txt warnings REGEX "[.]hpp:[0-9]+|/README.md:[0-9]+")
  # Warnings about pages of docs/ are ignored. Types and functions need a comment; members with a
  # self-explanatory name, mathematical operators and implicit functions need none.
  list(FILTER warnings EXCLUDE REGEX "\\(variable\\)|Member operator|=default|&&\\) noexcept")
  if(warnings)
    list(JOIN warnings "\n" text)
    message(FATAL_ERROR "the API reference has gaps or errors:\n${text}")
  endif()
  message(STATUS "${FOLDER}/html/index.html")
  return()
endif()

find_program(PHYXEL_DOXYGEN doxygen)
mark_as_advanced(PHYXEL_DOXYGEN)
if(NOT PHYXEL_DOXYGEN)
  message(STATUS "no Doxygen: no target `docs` (Debian: apt-get install doxygen)")
  return()
endif()
set(PHYXEL_DOCS_DIR ${PROJECT_BINARY_DIR}/docs)
configure_file(${PROJECT_SOURCE_DIR}/docs/Doxyfile.in ${PHYXEL_DOCS_DIR}/Doxyfile @ONLY)
set(PHYXEL_DOCS_COMMAND ${CMAKE_COMMAND} -DDOXYGEN=${PHYXEL_DOXYGEN} -DFOLDER=${PHYXEL_DOCS_DIR}
                        -P ${CMAKE_CURRENT_LIST_FILE})
add_custom_target(docs COMMAND ${PHYXEL_DOCS_COMMAND} VERBATIM)

# PHYXEL_HAVE_PYTHON: whether the Python module is built. AUTO: if an interpreter with its headers,
# NumPy, pytest and pybind11 are there, and no sanitizers are wanted, which an interpreter would have to be
# built with, too.
set(default_of_python OFF)
if(PROJECT_IS_TOP_LEVEL)
  set(default_of_python AUTO)
endif()
set(PHYXEL_PYTHON ${default_of_python} CACHE STRING "The Python module: AUTO, ON or OFF")
set(PHYXEL_HAVE_PYTHON OFF)
if(PHYXEL_SANITIZE OR NOT (PHYXEL_PYTHON STREQUAL "AUTO" OR PHYXEL_PYTHON))
  return()
endif()

# Among several interpreters, the first that has NumPy and can test.
if(NOT DEFINED Python_EXECUTABLE)
  find_program(PHYXEL_PYTHON3 python3)
  mark_as_advanced(PHYXEL_PYTHON3)
  foreach(candidate IN ITEMS ${PHYXEL_PYTHON3} /usr/bin/python3)
    execute_process(COMMAND ${candidate} -c "import numpy, pytest" RESULT_VARIABLE failed
                    OUTPUT_QUIET ERROR_QUIET)
    if(failed EQUAL 0)
      set(Python_EXECUTABLE ${candidate})
      break()
    endif()
  endforeach()
  if(NOT Python_EXECUTABLE AND PHYXEL_PYTHON STREQUAL "AUTO")
    return()
  endif()
endif()
find_package(Python COMPONENTS Interpreter Development.Module)
set(PYBIND11_FINDPYTHON ON)
if(Python_FOUND)
  find_package(pybind11 CONFIG QUIET)
endif()
if(Python_FOUND AND pybind11_FOUND)
  set(PHYXEL_HAVE_PYTHON ON)
  set(CMAKE_POSITION_INDEPENDENT_CODE ON)  # of the libraries that go into the module
elseif(NOT PHYXEL_PYTHON STREQUAL "AUTO")
  message(FATAL_ERROR "PHYXEL_PYTHON=ON, but Python's headers or pybind11 were not found. On Debian: "
                      "apt-get install python3-dev pybind11-dev python3-numpy")
endif()

# Run by ctest with -P; see CMakeLists.txt for the variables. Any failing step is the test's.
set(prefix ${WORK}/prefix)
file(REMOVE_RECURSE ${WORK}/prefix ${WORK}/build)

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "exit code ${code} of: ${command}\n${out}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()

# The example prints how far its beam sags and what beam theory says; both must be there and
# agree within a tenth (six phyxels across: 3% was seen, falling to 2% with eight).
function(check_sag program)
  run(${program})
  if(NOT out MATCHES "sags ([0-9.]+) mm; beam theory says ([0-9.]+) mm")
    message(FATAL_ERROR "unexpected output of ${program}:\n${out}")
  endif()
  set(sag ${CMAKE_MATCH_1})
  set(theory ${CMAKE_MATCH_2})
  string(REPLACE "." "" sag_digits ${sag})        # both have one decimal: tenths of a millimetre
  string(REPLACE "." "" theory_digits ${theory})
  math(EXPR low "${theory_digits} * 90")
  math(EXPR high "${theory_digits} * 110")
  math(EXPR scaled "${sag_digits} * 100")
  if(scaled LESS low OR scaled GREATER high)
    message(FATAL_ERROR "the beam sags ${sag} mm, beam theory says ${theory} mm")
  endif()
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD} --config ${CONFIG} --prefix ${prefix})
run(${prefix}/${BINDIR}/phyxel --version)
if(NOT out MATCHES "phyxel ${VERSION}")
  message(FATAL_ERROR "the installed program says ${out}")
endif()

run(${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/build -G ${GENERATOR}
    "-DCMAKE_PREFIX_PATH=${prefix};${PREFIX_PATH}" -DCMAKE_CXX_COMPILER=${COMPILER}
    -DCMAKE_BUILD_TYPE=${CONFIG} -DCMAKE_CXX_FLAGS=${FLAGS})
run(${CMAKE_COMMAND} --build ${WORK}/build --config ${CONFIG})
check_sag(${WORK}/build/link_library)

find_program(pkg_config NAMES pkg-config pkgconf)
if(NOT pkg_config)
  message(STATUS "no pkg-config: that half is not tested")
  return()
endif()
set(ENV{PKG_CONFIG_PATH} ${prefix}/${LIBDIR}/pkgconfig)
run(${pkg_config} --modversion phyxel)
string(STRIP "${out}" out)
if(NOT out STREQUAL VERSION)
  message(FATAL_ERROR "pkg-config says version ${out}, not ${VERSION}")
endif()
run(${pkg_config} --static --cflags --libs phyxel)
string(STRIP "${out}" flags)
separate_arguments(flags UNIX_COMMAND "${flags} ${FLAGS}")
run(${COMPILER} -std=c++20 -O2 ${SOURCE}/main.cpp -o ${WORK}/build/with_pkg_config ${flags}
    -Wl,-rpath,${prefix}/${LIBDIR})
check_sag(${WORK}/build/with_pkg_config)

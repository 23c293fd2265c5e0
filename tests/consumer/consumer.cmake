# Run by ctest with -P; see CMakeLists.txt for the variables. Any failing step is the test's.
set(prefix ${WORK}/prefix)
file(REMOVE_RECURSE ${WORK}/prefix ${WORK}/build)

include(${CMAKE_CURRENT_LIST_DIR}/../support/run.cmake)

# Two numbers that a program prints, with as many decimals each, in the pattern's two groups, must
# agree within so many thousandths of the second. What it prints is put into `out`.
function(check_near thousandths pattern)
  run(${ARGN})
  if(NOT out MATCHES "${pattern}")
    message(FATAL_ERROR "no \"${pattern}\" in what ${ARGN} prints:\n${out}")
  endif()
  set(digits 1${CMAKE_MATCH_1} 1${CMAKE_MATCH_2})  # 1: else leading zeros are no numbers
  string(REPLACE "." "" digits "${digits}")
  list(POP_FRONT digits first second)
  string(REGEX REPLACE "^10*" "" reference ${second})
  math(EXPR error "1000 * (${first} - ${second})")
  math(EXPR most "${thousandths} * ${reference}")
  if(error GREATER most OR error LESS -${most})
    message(FATAL_ERROR "${CMAKE_MATCH_0}: more than ${thousandths} thousandths apart:\n${out}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()

# How far its beam sags and what beam theory says: within a tenth (six phyxels across: 3% was seen,
# falling to 2% with eight).
function(check_sag program)
  check_near(100 "sags ([0-9.]+) mm; beam theory says ([0-9.]+) mm" ${program})
endfunction()

# A bar's force against Hooke's law, within a hundredth (0.2% was seen), and its work against the
# energy gained: sums of the same forces, whose trapezia miss 1e-6 of it.
function(check_pull program)
  check_near(10 "force: ([0-9.]+) N; Hooke says ([0-9.]+) N" ${program})
  check_near(1 "work: ([0-9.]+) J; energy gained: ([0-9.]+) J" ${program})
endfunction()

# Momentum against impulse: but for the last digit printed of seven, sums of the same forces.
function(check_impulse program)
  check_near(1 "upwards: momentum gained ([0-9.]+) kg m/s; impulse ([0-9.]+) kg m/s" ${program})
  check_near(1 "sideways: momentum gained ([0-9.]+) kg m/s; impulse ([0-9.]+) kg m/s" ${program})
endfunction()

# A homogeneous stretch, which phyxels on a block's faces follow: within a hundredth of the law
# (0.01% was seen), where Hooke's would be 60% off.
function(check_rubber program)
  check_near(10 "force: ([0-9.]+) N; the law says ([0-9.]+) N" ${program})
endfunction()

# The energy of a body that swings freely changes by far less than a thousandth of what gravity has
# given it (0.1 per mille was seen), and its frames are there: one at the start, and ten more.
function(check_swing program)
  set(folder ${WORK}/build/swing)
  file(REMOVE_RECURSE ${folder})
  set(swing ${program} ${EXAMPLES}/mesh/ring.obj ${folder})
  run(${swing})
  string(REGEX MATCH "gravity gave ([0-9.]+) J; the sum of all changed by 0.0([0-9]+) J" found "${out}")
  if(NOT found OR CMAKE_MATCH_1 LESS 10 OR CMAKE_MATCH_2 GREATER 10000)
    message(FATAL_ERROR "unexpected output of ${program}:\n${out}")
  endif()
  file(GLOB frames ${folder}/surface_0*.hdf)
  list(LENGTH frames count)
  if(NOT count EQUAL 11 OR NOT out MATCHES "2000 phyxels, [0-9]+ steps, 11 frames")
    message(FATAL_ERROR "${count} frames in ${folder}:\n${out}")
  endif()
  execute_process(COMMAND ${swing} RESULT_VARIABLE code ERROR_VARIABLE error OUTPUT_QUIET)
  if(NOT code EQUAL 2 OR NOT error MATCHES "^simulate_mesh: error: .*holds an earlier trajectory")
    message(FATAL_ERROR "exit code ${code} of a second run into ${folder}, which says: ${error}")
  endif()
endfunction()

# The example's centre of mass falls as a point would, whatever the block does meanwhile: to the
# twenty micrometres that floats leave. What it prints of physics is put into `physics`.
function(check_fall)
  run(${ARGN} 4000 60)
  if(NOT out MATCHES "fell ([0-9.]+) m; gravity says ([0-9.]+) m")
    message(FATAL_ERROR "unexpected output of ${ARGN}:\n${out}")
  endif()
  set(fell ${CMAKE_MATCH_1})
  set(gravity ${CMAKE_MATCH_2})
  string(REPLACE "." "" fell_digits ${fell})  # both have six decimals: micrometres
  string(REPLACE "." "" gravity_digits ${gravity})
  math(EXPR error "1${fell_digits} - 1${gravity_digits}")  # 1: else leading zeros are no numbers
  if(gravity LESS 0.05 OR error LESS -20 OR error GREATER 20)
    message(FATAL_ERROR "the centre of mass fell ${fell} m, gravity says ${gravity} m:\n${out}")
  endif()
  string(REGEX MATCH "[0-9]+ steps to t = .*" physics "${out}")
  set(physics "${physics}" PARENT_SCOPE)
  set(out "${out}" PARENT_SCOPE)
endfunction()

# In the environment: `run` would take a list of several folders apart.
list(JOIN PREFIX_PATH ":" more)
set(ENV{CMAKE_PREFIX_PATH} "${prefix}:${more}")
function(build example)
  run(${CMAKE_COMMAND} -S ${EXAMPLES}/${example} -B ${WORK}/build/${example} -G ${GENERATOR}
      -DCMAKE_CXX_COMPILER=${COMPILER}
      -DCMAKE_BUILD_TYPE=${CONFIG})
  run(${CMAKE_COMMAND} --build ${WORK}/build/${example} --config ${CONFIG})
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD} --config ${CONFIG} --prefix ${prefix})
run(${prefix}/${BINDIR}/phyxel --version)
if(NOT out MATCHES "phyxel ${VERSION}")
  message(FATAL_ERROR "the installed program says ${out}")
endif()

# Semantic versioning: before 1.0 another minor version may break who asks for this one.
function(check_version asked_major asked_minor expected)
  set(asked ${asked_major}.${asked_minor})
  set(PACKAGE_FIND_VERSION ${asked})  # what find_package sets
  set(PACKAGE_FIND_VERSION_MAJOR ${asked_major})
  set(PACKAGE_FIND_VERSION_MINOR ${asked_minor})
  include(${prefix}/${LIBDIR}/cmake/phyxel/phyxelConfigVersion.cmake)
  if(NOT PACKAGE_VERSION_COMPATIBLE STREQUAL expected)
    message(FATAL_ERROR "who asks for ${asked} is told that ${VERSION} is compatible: "
                        "${PACKAGE_VERSION_COMPATIBLE}, not ${expected}")
  endif()
endfunction()
string(REGEX MATCH "^([0-9]+)[.]([0-9]+)" found ${VERSION})
set(major ${CMAKE_MATCH_1})
set(minor ${CMAKE_MATCH_2})
math(EXPR next_minor "${minor} + 1")
math(EXPR next_major "${major} + 1")
check_version(${major} ${minor} TRUE)
check_version(${major} ${next_minor} FALSE)
check_version(${next_major} 0 FALSE)

build(link_library)
check_sag(${WORK}/build/link_library/link_library)
build(simulate_mesh)
check_swing(${WORK}/build/simulate_mesh/simulate_mesh)
build(step_loop)
check_pull(${WORK}/build/step_loop/step_loop)
build(custom_load)
check_impulse(${WORK}/build/custom_load/custom_load)
build(custom_material)
check_rubber(${WORK}/build/custom_material/custom_material)
build(large_body)
set(large_body ${WORK}/build/large_body/large_body)
check_fall(${large_body})
set(physics_of_one "${physics}")
execute_process(COMMAND ${large_body} 5 RESULT_VARIABLE code ERROR_VARIABLE error OUTPUT_QUIET)
if(NOT code EQUAL 2 OR NOT error MATCHES "^large_body: error: phyxels 5: allowed are 64 to [0-9]+\n$")
  message(FATAL_ERROR "exit code ${code} of large_body 5, which says: ${error}")
endif()
if(MPIRUN)
  # Two cores hold two ranks of one thread. Open MPI keeps what its modules have allocated.
  set(ENV{OMP_NUM_THREADS} 1)
  set(ENV{ASAN_OPTIONS} detect_leaks=0)
  set(two_ranks ${MPIRUN} --allow-run-as-root --oversubscribe -n 2 ${large_body})
  check_fall(${two_ranks})
  if(NOT physics STREQUAL physics_of_one OR NOT out MATCHES "2 ranks.* ([1-9][0-9]*) bytes of ghosts")
    message(FATAL_ERROR "two ranks:\n${out}\none:\n${physics_of_one}")
  endif()
  execute_process(COMMAND ${two_ranks} 5 RESULT_VARIABLE code ERROR_VARIABLE error OUTPUT_QUIET)
  string(REGEX MATCHALL "large_body: error: phyxels 5" told "${error}")
  list(LENGTH told times)
  if(NOT code EQUAL 2 OR NOT times EQUAL 1)
    message(FATAL_ERROR "exit code ${code} of large_body 5 on two ranks, which say: ${error}")
  endif()
  unset(ENV{OMP_NUM_THREADS})
  unset(ENV{ASAN_OPTIONS})
else()
  without_tool(Install.Consumer "MPI, for two ranks of large_body")
endif()

find_program(pkg_config NAMES pkg-config pkgconf)
if(NOT pkg_config)
  without_tool(Install.Consumer "pkg-config")
  return()
endif()
set(ENV{PKG_CONFIG_PATH} ${prefix}/${LIBDIR}/pkgconfig)
function(build_with_pkg_config example package)
  run(${pkg_config} --modversion ${package})
  string(STRIP "${out}" out)
  if(NOT out STREQUAL VERSION)
    message(FATAL_ERROR "pkg-config says version ${out} of ${package}, not ${VERSION}")
  endif()
  run(${pkg_config} --static --cflags --libs ${package})
  string(STRIP "${out}" flags)
  separate_arguments(flags UNIX_COMMAND "${flags}")
  run(${COMPILER} -std=c++20 -O2 ${EXAMPLES}/${example}/main.cpp
      -o ${WORK}/build/${example}/with_pkg_config ${flags} -Wl,-rpath,${prefix}/${LIBDIR})
endfunction()
build_with_pkg_config(link_library phyxel)
check_sag(${WORK}/build/link_library/with_pkg_config)
build_with_pkg_config(large_body phyxel-ranks)
check_fall(${WORK}/build/large_body/with_pkg_config)

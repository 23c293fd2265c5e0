# cmake --install: headers, libraries, program, and the ways to find them: find_package(phyxel) and
# pkg-config; the program's manual page, completions, scenes and examples. Packages take it in two
# components, `runtime` and `development`. phyxel::ranks and what it is made of are exported apart, so that who links
# phyxel::phyxel alone need not have METIS, MPI or CUDA.

include(CMakePackageConfigHelpers)
set(phyxel_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/phyxel)

function(phyxel_install_libraries export)
  install(TARGETS ${ARGN} EXPORT ${export}
    ARCHIVE COMPONENT development
    LIBRARY COMPONENT runtime NAMELINK_COMPONENT development)
  install(EXPORT ${export} NAMESPACE phyxel:: DESTINATION ${phyxel_cmake_dir} COMPONENT development)
endfunction()
phyxel_install_libraries(phyxelTargets phyxel)
if(TARGET phyxel_ranks)
  phyxel_install_libraries(phyxelRanksTargets phyxel_ranks phyxel_mpi phyxel_partition phyxel_cuda)
endif()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/lib/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        COMPONENT development FILES_MATCHING PATTERN "*.hpp")

if(BUILD_SHARED_LIBS)
  set(PHYXEL_IS_STATIC OFF)
else()
  set(PHYXEL_IS_STATIC ON)
endif()
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/phyxelConfig.cmake.in
  ${PROJECT_BINARY_DIR}/phyxelConfig.cmake INSTALL_DESTINATION ${phyxel_cmake_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/phyxelConfigVersion.cmake
  COMPATIBILITY ${PHYXEL_COMPATIBILITY})
install(FILES ${PROJECT_BINARY_DIR}/phyxelConfig.cmake ${PROJECT_BINARY_DIR}/phyxelConfigVersion.cmake
              ${PROJECT_SOURCE_DIR}/cmake/PhyxelHdf5.cmake ${PROJECT_SOURCE_DIR}/cmake/PhyxelMpi.cmake
              ${PROJECT_SOURCE_DIR}/cmake/FindMETIS.cmake
        DESTINATION ${phyxel_cmake_dir} COMPONENT development)

# Linking a static library takes `pkg-config --static`.
file(RELATIVE_PATH pc_to_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
# phyxel_pkg_config(package description requires requires-private library private-link-flag...)
function(phyxel_pkg_config pc_name pc_description pc_requires pc_requires_private pc_library)
  list(JOIN ARGN " " pc_private)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/phyxel.pc.in ${PROJECT_BINARY_DIR}/${pc_name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${pc_name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
          COMPONENT development)
endfunction()
if(BUILD_SHARED_LIBS)  # which say themselves what they need
  phyxel_pkg_config(phyxel "${PROJECT_DESCRIPTION}" "" "" phyxel)
else()
  phyxel_pkg_config(phyxel "${PROJECT_DESCRIPTION}" "" fmt phyxel ${OpenMP_CXX_FLAGS}
                    ${PHYXEL_HDF5_LIBRARY})
endif()
if(TARGET phyxel_ranks AND BUILD_SHARED_LIBS)
  phyxel_pkg_config(phyxel-ranks "phyxel on the ranks of a program, and on GPUs" phyxel "" phyxel_ranks)
elseif(TARGET phyxel_ranks)
  set(private ${METIS_LIBRARY})
  if(PHYXEL_HAVE_MPI)
    list(APPEND private ${MPI_CXX_LIBRARIES})
  endif()
  if(PHYXEL_HAVE_CUDA AND NOT BUILD_SHARED_LIBS)
    list(APPEND private ${CUDAToolkit_LIBRARY_DIR}/libcudart_static.a -lrt -lpthread -ldl)
  endif()
  phyxel_pkg_config(phyxel-ranks "phyxel on the ranks of a program, and on GPUs" phyxel "" phyxel_ranks
                    -lphyxel_mpi -lphyxel_partition -lphyxel_cuda ${private})
endif()

install(FILES ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md
        DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright
        COMPONENT runtime)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libphyxel-dev
        RENAME copyright COMPONENT development)  # where Debian wants each package's own
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)
# What the README links to, where its links find it.
install(FILES ${PROJECT_SOURCE_DIR}/CONTRIBUTING.md ${PROJECT_SOURCE_DIR}/CITATION.cff ${PROJECT_SOURCE_DIR}/LICENSE
        DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)

# What the program says of itself, made by it.
if(NOT CMAKE_CROSSCOMPILING)
  set(said_dir ${PROJECT_BINARY_DIR}/said)
  set(said "")
  # phyxel_say(file folder command...): keeps what a command prints, and installs it.
  function(phyxel_say file folder)
    add_custom_command(OUTPUT ${said_dir}/${file}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${said_dir}
      COMMAND ${ARGN} > ${said_dir}/${file} DEPENDS phyxel_program VERBATIM)
    install(FILES ${said_dir}/${file} DESTINATION ${folder} COMPONENT runtime)
    set(said ${said} ${said_dir}/${file} PARENT_SCOPE)
  endfunction()
  set(program $<TARGET_FILE:phyxel_program>)
  phyxel_say(phyxel ${CMAKE_INSTALL_DATADIR}/bash-completion/completions ${program} completion bash)
  phyxel_say(_phyxel ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions ${program} completion zsh)
  phyxel_say(phyxel.fish ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d ${program} completion fish)
  find_program(PHYXEL_HELP2MAN help2man)
  mark_as_advanced(PHYXEL_HELP2MAN)
  if(PHYXEL_HELP2MAN)
    phyxel_say(phyxel.1 ${CMAKE_INSTALL_MANDIR}/man1 ${PHYXEL_HELP2MAN} --no-info
               --name=${PROJECT_DESCRIPTION} --version-string=${PROJECT_VERSION} ${program})
  else()
    message(STATUS "no help2man: no manual page (Debian: apt-get install help2man)")
  endif()
  add_custom_target(phyxel_said ALL DEPENDS ${said})
endif()

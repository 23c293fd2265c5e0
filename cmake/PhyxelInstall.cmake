# cmake --install: headers, libraries, program, and the ways to find them: find_package(phyxel) and
# pkg-config. phyxel::ranks and what it is made of are exported apart, so that who links
# phyxel::phyxel alone need not have METIS, MPI or CUDA.

include(CMakePackageConfigHelpers)
set(phyxel_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/phyxel)

install(TARGETS phyxel EXPORT phyxelTargets)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/lib/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        FILES_MATCHING PATTERN "*.hpp")
install(EXPORT phyxelTargets NAMESPACE phyxel:: DESTINATION ${phyxel_cmake_dir})
if(TARGET phyxel_ranks)
  install(TARGETS phyxel_ranks phyxel_mpi phyxel_partition phyxel_cuda EXPORT phyxelRanksTargets)
  install(EXPORT phyxelRanksTargets NAMESPACE phyxel:: DESTINATION ${phyxel_cmake_dir})
endif()

if(BUILD_SHARED_LIBS)
  set(PHYXEL_IS_STATIC OFF)
else()
  set(PHYXEL_IS_STATIC ON)
endif()
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/phyxelConfig.cmake.in
  ${PROJECT_BINARY_DIR}/phyxelConfig.cmake INSTALL_DESTINATION ${phyxel_cmake_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/phyxelConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/phyxelConfig.cmake ${PROJECT_BINARY_DIR}/phyxelConfigVersion.cmake
              ${PROJECT_SOURCE_DIR}/cmake/PhyxelHdf5.cmake ${PROJECT_SOURCE_DIR}/cmake/PhyxelMpi.cmake
              ${PROJECT_SOURCE_DIR}/cmake/FindMETIS.cmake
        DESTINATION ${phyxel_cmake_dir})

# Linking a static library takes `pkg-config --static`.
file(RELATIVE_PATH pc_to_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
# phyxel_pkg_config(package description requires requires-private library private-link-flag...)
function(phyxel_pkg_config pc_name pc_description pc_requires pc_requires_private pc_library)
  list(JOIN ARGN " " pc_private)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/phyxel.pc.in ${PROJECT_BINARY_DIR}/${pc_name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${pc_name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endfunction()
phyxel_pkg_config(phyxel "${PROJECT_DESCRIPTION}" "" fmt phyxel ${OpenMP_CXX_FLAGS}
                  ${PHYXEL_HDF5_LIBRARY})
if(TARGET phyxel_ranks)
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

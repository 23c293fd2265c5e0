# cmake --install: headers, library, program, and the ways to find them: find_package(phyxel) and
# pkg-config.

include(CMakePackageConfigHelpers)
set(phyxel_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/phyxel)

install(TARGETS phyxel EXPORT phyxelTargets)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/lib/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        FILES_MATCHING PATTERN "*.hpp")
install(EXPORT phyxelTargets NAMESPACE phyxel:: DESTINATION ${phyxel_cmake_dir})

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
              ${PROJECT_SOURCE_DIR}/cmake/PhyxelHdf5.cmake
        DESTINATION ${phyxel_cmake_dir})

# Linking the static library takes `pkg-config --static`.
set(pc_private "${OpenMP_CXX_FLAGS} ${PHYXEL_HDF5_LIBRARY}")
file(RELATIVE_PATH pc_to_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(${PROJECT_SOURCE_DIR}/cmake/phyxel.pc.in ${PROJECT_BINARY_DIR}/phyxel.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/phyxel.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

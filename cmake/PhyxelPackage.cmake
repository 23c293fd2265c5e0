# cpack: a relocatable archive of the installation, and two Debian packages, phyxel (the program) and libphyxel-dev (headers
# and libraries). `cmake --workflow --preset package` makes them for other machines.
set(CPACK_PACKAGE_VENDOR "the phyxel authors")
set(CPACK_PACKAGE_CONTACT "the phyxel authors <maintainers@phyxel.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGE_DESCRIPTION
"phyxel simulates deformable bodies made of phyxels, physics points without a
mesh, that carry surfels, the points of their surface: total-Lagrangian moving
least squares after Mueller et al. 2004 and Farias et al. 2008. It runs scenes
on CPUs, on NVIDIA GPUs if it was built with CUDA, and on the ranks of MPI.")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_RESOURCE_FILE_README ${PROJECT_SOURCE_DIR}/README.md)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE
    GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)  # whatever the umask
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_SOURCE_GENERATOR TGZ)
set(CPACK_SOURCE_IGNORE_FILES "/\\.git/" "${PROJECT_SOURCE_DIR}/build/" "${PROJECT_SOURCE_DIR}/out/"
                              "${PROJECT_SOURCE_DIR}/shared")
set(CPACK_GENERATOR TGZ)

find_program(PHYXEL_SHLIBDEPS dpkg-shlibdeps)
mark_as_advanced(PHYXEL_SHLIBDEPS)
if(PHYXEL_SHLIBDEPS)
  list(APPEND CPACK_GENERATOR DEB)
  set(CPACK_DEB_COMPONENT_INSTALL ON)
  set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME phyxel)
  set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION science)
  set(CPACK_DEBIAN_RUNTIME_PACKAGE_SUGGESTS "openmpi-bin, paraview, gnuplot-nox, ffmpeg")
  set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libphyxel-dev)
  set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
  set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "phyxel (= ${PROJECT_VERSION}), cmake, pkg-config")
  # A static library needs at link time what a shared one brings along.
  if(BUILD_SHARED_LIBS)
    set(needed "phyxel (= ${PROJECT_VERSION})")
    set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_LIBRARY_OUTPUT_DIRECTORY})
  else()
    set(needed libfmt-dev libmetis-dev)
    if(PHYXEL_HDF5_IS_PARALLEL)
      list(APPEND needed libhdf5-openmpi-dev)
    else()
      list(APPEND needed libhdf5-dev)
    endif()
    if(PHYXEL_HAVE_MPI)
      list(APPEND needed libopenmpi-dev)
    endif()
  endif()
  list(JOIN needed ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS)
  # Debian's own folders, wherever else cmake --install would go.
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/PhyxelPackageProject.cmake @ONLY CONTENT [[
if(CPACK_GENERATOR STREQUAL "DEB")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
endif()
]])
  set(CPACK_PROJECT_CONFIG_FILE ${PROJECT_BINARY_DIR}/PhyxelPackageProject.cmake)
endif()

set(CPACK_COMPONENTS_ALL runtime development)
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION "The program, its manual page, completions of shells, scenes and examples.")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Headers, libraries, and what CMake and pkg-config need to find them.")
include(CPack)

# phyxel::hdf5, the C library of HDF5, with PHYXEL_PARALLEL_HDF5 the one that knows MPI. Used by the
# build and, installed, by phyxelConfig.
# CMake's own FindHDF5 is not used: it insists on the language C, and links everything that the
# wrapper h5cc names (on Debian curl and OpenSSL).

if(TARGET phyxel::hdf5)
  return()
endif()
set(hdf5_kinds serial)
if(PHYXEL_PARALLEL_HDF5)
  set(hdf5_kinds openmpi mpich)
endif()
list(TRANSFORM hdf5_kinds PREPEND hdf5/ OUTPUT_VARIABLE hdf5_folders)
list(TRANSFORM hdf5_kinds PREPEND hdf5_ OUTPUT_VARIABLE hdf5_names)
find_path(PHYXEL_HDF5_INCLUDE_DIR hdf5.h PATH_SUFFIXES ${hdf5_folders} HINTS ENV HDF5_ROOT)
find_library(PHYXEL_HDF5_LIBRARY NAMES ${hdf5_names} hdf5 PATH_SUFFIXES ${hdf5_folders}
             HINTS ENV HDF5_ROOT)
mark_as_advanced(PHYXEL_HDF5_INCLUDE_DIR PHYXEL_HDF5_LIBRARY)
if(NOT PHYXEL_HDF5_INCLUDE_DIR OR NOT PHYXEL_HDF5_LIBRARY)
  message(FATAL_ERROR "The HDF5 library was not found. On Debian: apt-get install libhdf5-dev, or "
                      "libhdf5-openmpi-dev for PHYXEL_PARALLEL_HDF5; elsewhere set "
                      "PHYXEL_HDF5_INCLUDE_DIR and PHYXEL_HDF5_LIBRARY.")
endif()
file(STRINGS ${PHYXEL_HDF5_INCLUDE_DIR}/H5pubconf.h PHYXEL_HDF5_IS_PARALLEL
     REGEX "^#define H5_HAVE_PARALLEL 1")
if(PHYXEL_HDF5_IS_PARALLEL)
  set(PHYXEL_HDF5_IS_PARALLEL ON)
elseif(PHYXEL_PARALLEL_HDF5)
  message(FATAL_ERROR "PHYXEL_PARALLEL_HDF5=ON, but ${PHYXEL_HDF5_INCLUDE_DIR} is of a serial HDF5. "
                      "On Debian: apt-get install libhdf5-openmpi-dev; elsewhere set "
                      "PHYXEL_HDF5_INCLUDE_DIR and PHYXEL_HDF5_LIBRARY.")
endif()
file(STRINGS ${PHYXEL_HDF5_INCLUDE_DIR}/H5public.h PHYXEL_HDF5_VERSION
     REGEX "^#define H5_VERS_INFO")
string(REGEX REPLACE ".*version: ([0-9][0-9.]*).*" "\\1" PHYXEL_HDF5_VERSION "${PHYXEL_HDF5_VERSION}")
add_library(phyxel::hdf5 UNKNOWN IMPORTED GLOBAL)
set_target_properties(phyxel::hdf5 PROPERTIES
  IMPORTED_LOCATION ${PHYXEL_HDF5_LIBRARY}
  INTERFACE_INCLUDE_DIRECTORIES ${PHYXEL_HDF5_INCLUDE_DIR})
if(PHYXEL_HDF5_IS_PARALLEL)  # its header includes mpi.h
  find_package(MPI REQUIRED COMPONENTS CXX)
  set_target_properties(phyxel::hdf5 PROPERTIES INTERFACE_LINK_LIBRARIES MPI::MPI_CXX)
endif()

# phyxel::hdf5, the serial C library of HDF5. Used by the build and, installed, by phyxelConfig.
# CMake's own FindHDF5 is not used: it insists on the language C, and links everything that the
# wrapper h5cc names (on Debian curl and OpenSSL).

if(TARGET phyxel::hdf5)
  return()
endif()
find_path(PHYXEL_HDF5_INCLUDE_DIR hdf5.h PATH_SUFFIXES hdf5/serial HINTS ENV HDF5_ROOT)
find_library(PHYXEL_HDF5_LIBRARY NAMES hdf5_serial hdf5 PATH_SUFFIXES hdf5/serial HINTS ENV HDF5_ROOT)
mark_as_advanced(PHYXEL_HDF5_INCLUDE_DIR PHYXEL_HDF5_LIBRARY)
if(NOT PHYXEL_HDF5_INCLUDE_DIR OR NOT PHYXEL_HDF5_LIBRARY)
  message(FATAL_ERROR "The serial HDF5 library was not found. On Debian: apt-get install libhdf5-dev; "
                      "elsewhere set PHYXEL_HDF5_INCLUDE_DIR and PHYXEL_HDF5_LIBRARY.")
endif()
file(STRINGS ${PHYXEL_HDF5_INCLUDE_DIR}/H5public.h PHYXEL_HDF5_VERSION
     REGEX "^#define H5_VERS_INFO")
string(REGEX REPLACE ".*version: ([0-9][0-9.]*).*" "\\1" PHYXEL_HDF5_VERSION "${PHYXEL_HDF5_VERSION}")
add_library(phyxel::hdf5 UNKNOWN IMPORTED GLOBAL)
set_target_properties(phyxel::hdf5 PROPERTIES
  IMPORTED_LOCATION ${PHYXEL_HDF5_LIBRARY}
  INTERFACE_INCLUDE_DIRECTORIES ${PHYXEL_HDF5_INCLUDE_DIR})

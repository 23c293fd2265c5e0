# The dependencies of the library and the program. CMAKE_PREFIX_PATH may name their folders.
#
# Header-only use of toml++, xxHash and tinyobjloader keeps them out of what an installed
# libphyxel needs: only fmt, HDF5 and OpenMP are left for cmake/phyxelConfig.cmake.in to find.

include(PhyxelHdf5)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(OpenMP REQUIRED COMPONENTS CXX)
find_package(CLI11 REQUIRED)
find_package(PNG REQUIRED)
find_package(METIS REQUIRED)

# phyxel_header_library(NAME header debian-package [definition...]): a library that is one header.
function(phyxel_header_library name header package)
  string(TOUPPER PHYXEL_${name}_INCLUDE_DIR variable)
  find_path(${variable} ${header})
  mark_as_advanced(${variable})
  if(NOT ${variable})
    message(FATAL_ERROR "The header ${header} was not found. On Debian: apt-get install ${package}; "
                        "elsewhere set ${variable} to its folder.")
  endif()
  add_library(phyxel_${name} INTERFACE IMPORTED GLOBAL)
  target_include_directories(phyxel_${name} SYSTEM INTERFACE ${${variable}})
  target_compile_definitions(phyxel_${name} INTERFACE ${ARGN})
endfunction()

phyxel_header_library(toml toml++/toml.h libtomlplusplus-dev TOML_HEADER_ONLY=1)
phyxel_header_library(xxhash xxhash.h libxxhash-dev XXH_INLINE_ALL=)
phyxel_header_library(tinyobj tiny_obj_loader.h libtinyobjloader-dev)

# MPI::MPI_CXX without MPI's C++ bindings, which MPI 3 has removed; phyxel uses the C functions. The file is installed beside
# phyxelConfig.cmake, for programs that link a static phyxel::ranks.
set(MPI_CXX_SKIP_MPICXX ON)
find_package(MPI COMPONENTS CXX QUIET)
if(MPI_CXX_FOUND)
  list(FILTER MPI_CXX_LIBRARIES EXCLUDE REGEX "mpi_cxx|mpichcxx")
  get_target_property(mpi_libraries MPI::MPI_CXX INTERFACE_LINK_LIBRARIES)
  if(mpi_libraries)  # empty if the compiler is MPI's wrapper, which links MPI itself
    list(FILTER mpi_libraries EXCLUDE REGEX "mpi_cxx|mpichcxx")
    set_target_properties(MPI::MPI_CXX PROPERTIES INTERFACE_LINK_LIBRARIES "${mpi_libraries}")
  endif()
endif()

# MPI::MPI_CXX without MPI's own C++ library: the C functions will do, C++ has been gone since MPI 3, and from some MPIs,
# too. Installed beside phyxelConfig.cmake, so that who links a static phyxel::ranks gets the same.
set(MPI_CXX_SKIP_MPICXX ON)
find_package(MPI COMPONENTS CXX QUIET)
if(MPI_CXX_FOUND)
  list(FILTER MPI_CXX_LIBRARIES EXCLUDE REGEX "mpi_cxx|mpichcxx")
  get_target_property(mpi_libraries MPI::MPI_CXX INTERFACE_LINK_LIBRARIES)
  if(mpi_libraries)  # else the compiler is MPI's own, which links it unasked
    list(FILTER mpi_libraries EXCLUDE REGEX "mpi_cxx|mpichcxx")
    set_target_properties(MPI::MPI_CXX PROPERTIES INTERFACE_LINK_LIBRARIES "${mpi_libraries}")
  endif()
endif()

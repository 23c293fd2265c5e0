# phyxel_page_files(target file...): embeds the files of `phyxel report`'s pages, for `page_file(name)` of
# report/page_files.hpp.
function(phyxel_page_files target)
  set(made ${CMAKE_CURRENT_BINARY_DIR}/page_files.cpp)
  set(text "#include \"report/page_files.hpp\"\n\nnamespace phyxel::app {\n\n")
  string(APPEND text "std::string_view page_file(std::string_view name) {\n")
  foreach(file IN LISTS ARGN)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
    file(READ ${file} content)
    get_filename_component(name ${file} NAME)
    # In pieces, since compilers limit the length of literals. No file has a line equal to this delimiter.
    string(REPLACE "\n" "\n)phyxel\" R\"phyxel(" content "${content}")
    string(APPEND text "  if (name == \"${name}\") return R\"phyxel(${content})phyxel\";\n")
  endforeach()
  string(APPEND text "  return {};\n}\n\n}  // namespace phyxel::app\n")
  file(GENERATE OUTPUT ${made} CONTENT "${text}")
  target_sources(${target} PRIVATE ${made})
endfunction()

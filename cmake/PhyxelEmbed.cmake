# phyxel_embed(target function folder file...): embeds text files in the program; `function` of embedded_files.hpp returns
# them, by their paths from the folder.
function(phyxel_embed target function folder)
  set(made ${CMAKE_CURRENT_BINARY_DIR}/${function}.cpp)
  set(text "#include \"embedded_files.hpp\"\n\nnamespace phyxel::app {\n\n")
  # The suffix sv gives the length of a text, which compilers would otherwise count, up to a limit.
  string(APPEND text "using namespace std::string_view_literals;\n\n")
  string(APPEND text "std::span<const EmbeddedFile> ${function}() {\n  static constexpr EmbeddedFile files[] = {\n")
  foreach(file IN LISTS ARGN)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
    file(READ ${file} content)
    file(RELATIVE_PATH name ${folder} ${file})
    # In pieces, since compilers limit the length of literals. No file has a line equal to this delimiter.
    string(REPLACE "\n" "\n)phyxel\" R\"phyxel(" content "${content}")
    string(APPEND text "      {\"${name}\", R\"phyxel(${content})phyxel\"sv},\n")
  endforeach()
  string(APPEND text "  };\n  return files;\n}\n\n}  // namespace phyxel::app\n")
  file(GENERATE OUTPUT ${made} CONTENT "${text}")
  target_sources(${target} PRIVATE ${made})
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")  # which counts the characters of all pieces
    set_source_files_properties(${made} PROPERTIES COMPILE_OPTIONS -Wno-overlength-strings)
  endif()
endfunction()

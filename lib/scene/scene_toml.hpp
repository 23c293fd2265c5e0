/// The TOML parser, made safe against any text.
#pragma once

#include <filesystem>
#include <string>

namespace phyxel {
/// Thrown where the parser meets text that it did not foresee, such as "[{": by itself it would
/// abort, or with clang and NDEBUG go anywhere.
struct ParserLost {};
[[noreturn]] inline void lose_parser() { throw ParserLost{}; }
}  // namespace phyxel

// Header-only, so that these settings hold everywhere: tables nest four deep in a scene, and a
// parser that follows a hostile file much deeper would overflow the stack.
#undef TOML_SHARED_LIB
#undef TOML_HEADER_ONLY
#define TOML_HEADER_ONLY 1
#define TOML_MAX_NESTED_VALUES 16
#define TOML_ENABLE_FORMATTERS 0
#define TOML_ASSERT(expression) ((expression) ? void() : ::phyxel::lose_parser())
#pragma push_macro("NDEBUG")
#undef NDEBUG
// Where toml++ 3.3 holds a character outside ASCII for unreachable, it is simply none that TOML
// allows there.
#include <toml++/impl/forward_declarations.h>
#pragma push_macro("TOML_UNREACHABLE")
#undef TOML_UNREACHABLE
#define TOML_UNREACHABLE return false
#include <toml++/impl/unicode.h>
#pragma pop_macro("TOML_UNREACHABLE")
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")

namespace phyxel {

/// Room for 10000 bodies written one by one; the parser's time grows with their number squared.
constexpr std::size_t largest_scene_file = std::size_t{2} << 20;  // bytes

/// @throws InputError with file and line for anything that is not TOML.
toml::table parse_toml(const std::string& text, const std::filesystem::path& file);

}  // namespace phyxel

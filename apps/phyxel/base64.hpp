/// Base64, by which text files hold binary data.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace phyxel::app {

/// Base64 encoding by RFC 4648.
std::string base64(std::span<const std::byte> bytes);

}  // namespace phyxel::app

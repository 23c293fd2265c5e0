/// Boost.Beast, for the server of a live view and its tests.
#pragma once

// Boost.Asio 1.74 uses std::exchange without its header.
// clang-format off
#include <utility>
#include <boost/asio.hpp>
#include <boost/beast.hpp>
// clang-format on

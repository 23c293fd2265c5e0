/// Parts of the table of keys, and the ranges that its entries share.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "scene/scene_schema.hpp"

namespace phyxel {

/// Ranges of values, and the limits that they share.
namespace ranges {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr double largest_index = std::numeric_limits<std::int32_t>::max();

// What a scene may hold, so that products of its values (energies, volumes, moments) stay numbers
// in double precision: far beyond anything that bends.
inline constexpr double longest = 1e12;         // lengths [m], and how far from the origin
inline constexpr double shortest = 1e-12;       // [m]
inline constexpr double stiffest = 1e18;        // moduli [Pa]
inline constexpr double fastest = 1e9;          // speeds [m/s] and spins [rad/s]
inline constexpr double largest_angle = 1e9;    // [degrees]
inline constexpr double largest_force = 1e24;   // [N], [N/m^3]
inline constexpr double largest_factor = 1e12;  // of loads

inline Range at_least(double low) { return {low, infinity, false}; }
inline Range between(double low, double high) { return {low, high, false}; }
inline Range strictly_between(double low, double high) { return {low, high, true}; }
inline Range within(double size) { return {-size, size, false}; }
inline Range length() { return {shortest, longest, false}; }
inline Range time_span() { return {1e-18, 1e9, false}; }

}  // namespace ranges

/// The keys of a path, in the section of what moves along it.
std::vector<SceneKey> path_keys(const std::string& section);

/// The names of the shapes of obstacles.
std::vector<std::string> obstacle_names();

/// The keys of obstacles, but for those of their paths.
std::vector<SceneKey> obstacle_keys();

/// The keys of the contact of bodies with each other.
std::vector<SceneKey> contact_keys();

/// The keys of bodies that break.
std::vector<SceneKey> fracture_keys();

}  // namespace phyxel

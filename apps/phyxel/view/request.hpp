/// Requests of a page, or of a recorded session, to a live scene.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "phyxel/types.hpp"

namespace phyxel::app {

/// The values of a scene that a user changes while it runs; unset ones are those of the scene.
struct Settings {
  std::optional<Vec3d> gravity;     ///< [m/s²]
  std::optional<double> stiffness;  ///< Young's moduli over those of the scene.
  std::optional<double> damping;    ///< Mass-proportional damping of all bodies [1/s].
  std::optional<double> friction;   ///< Coulomb's coefficient of all contacts.
  /// Takes the values that `later` has set.
  void take(const Settings& later);
  bool operator==(const Settings&) const = default;
};

/// The kinds of requests. The first ones, up to `save`, are acts: they change the state or save it,
/// take effect at a step, and are recorded. The others concern the page alone.
enum class RequestKind { grab, move, drop, set, reset, save, play, pause, step, pace, show };

/// A request: its kind, and the members that belong to the kind.
struct Request {
  RequestKind kind = RequestKind::pause;
  Index phyxel = 0;        ///< grab: a global id.
  Vec3d by;                ///< move: where the hand is, from where it grabbed [m].
  Settings settings;       ///< set
  double number = 0;       ///< step: a count; pace: seconds simulated a second.
  std::string field = {};  ///< show: the name of a field, or "bodies".
  bool operator==(const Request&) const = default;
};

/// True for a request that is recorded.
bool is_act(RequestKind kind);

/// Parses a request: a JSON object with the kind as "do", e.g. {"do": "grab", "phyxel": 7}.
/// @throws InputError naming the key, its value and what is allowed
Request parse_request(std::string_view text);
/// The object that `parse_request` reads; numbers are exact.
nlohmann::ordered_json json_of(const Request& request);

}  // namespace phyxel::app

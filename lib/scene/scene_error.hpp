/// Refusals that name the scene they are about.
#pragma once

#include <string>

#include "phyxel/error.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

/// The message with the scene's file before it, unless it begins with that: "scene.toml: time.step
/// = 1 s is unstable". A scene read from text is called "scene", as its parser does; one made in
/// code has no name.
std::string named(const Scene& scene, const std::string& message);

/// The message with the body's place and name before it, unless it begins with a place in the same
/// file or with the body: "scene.toml:7:1: body "ball": ball.obj: the surface encloses no volume".
std::string named(const BodyRequest& body, const std::string& message);

/// `work()`, whose refusals name the scene or body: those that one rank throws and those that all
/// ranks have agreed on.
template <class Owner, class Work>
decltype(auto) naming(const Owner& owner, Work&& work) {
  try {
    return work();
  } catch (const InputError& error) {
    throw InputError(named(owner, error.what()));
  } catch (const AgreedError& error) {
    if (error.code() != ExitCode::bad_input) throw;
    throw AgreedError(error.code(), named(owner, error.what()));
  }
}

}  // namespace phyxel

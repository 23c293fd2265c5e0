/// The [contact] section of a scene file.
#pragma once

#include "scene/scene_table.hpp"

namespace phyxel {

/// Reads how bodies touch each other.
/// @throws InputError for names that no body has, for pairs found twice, and for friction of
/// sliding points above that of points that stick
ContactRequest read_contact(const SceneTable& table, const std::vector<BodyRequest>& bodies);

/// Checks what the table of keys cannot say of contact, made in code or read from a file.
/// @throws InputError naming the key, its value and what is allowed
void check_contact(const ContactRequest& contact, const std::vector<BodyRequest>& bodies);

/// Checks that obstacles that act by penalties have no restitution.
/// @throws InputError naming the obstacle and what is allowed
void check_penalties(const Scene& scene);

}  // namespace phyxel

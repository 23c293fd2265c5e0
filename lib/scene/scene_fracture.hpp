/// The [body.fracture] and [[body.notch]] sections of a scene file.
#pragma once

#include "scene/scene_table.hpp"

namespace phyxel {

/// Reads how a body breaks.
FractureRequest read_fracture(const SceneTable& table);

/// Reads a disc along which a body is cut. @throws InputError for a normal of length zero
NotchRequest read_notch(const SceneTable& table);

/// Moves the notches and the unbreakable regions of a copy of a body by a vector [m].
void move_fracture(BodyRequest& copy, Vec3d by);

/// Checks what the table of keys cannot say of a scene whose bodies break, made in code or read
/// from a file. @throws InputError naming the key, its value and what is allowed
void check_fracture_request(const Scene& scene);

}  // namespace phyxel

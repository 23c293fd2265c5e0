/// The list of all shapes of obstacles: one named here is available on every device, in scenes, in
/// pictures and in the reference of scenes.
#pragma once

#include "phyxel/physics/obstacles/box.hpp"
#include "phyxel/physics/obstacles/capsule.hpp"
#include "phyxel/physics/obstacles/cylinder.hpp"
#include "phyxel/physics/obstacles/mesh.hpp"
#include "phyxel/physics/obstacles/plane.hpp"
#include "phyxel/physics/obstacles/sphere.hpp"

namespace phyxel {

/// Every shape, in the order of the reference of scenes.
using ObstacleShapes = ObstacleList<PlaneObstacle, SphereObstacle, BoxObstacle, CylinderObstacle,
                                    CapsuleObstacle, MeshObstacle>;

}  // namespace phyxel

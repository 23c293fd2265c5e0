/// Everything public, in one include. What `device`, `ranks` and `shared_model` declare is in the
/// library phyxel::ranks, all else in phyxel::phyxel.
#pragma once

#include "phyxel/backend.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/cloud.hpp"
#include "phyxel/device.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "phyxel/neighbourhood.hpp"
#include "phyxel/ranks.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/shapes.hpp"
#include "phyxel/shared_model.hpp"
#include "phyxel/solver.hpp"
#include "phyxel/state.hpp"
#include "phyxel/stretches.hpp"
#include "phyxel/types.hpp"

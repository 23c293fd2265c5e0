/// Everything public, in one include.
#pragma once

#include "phyxel/backend.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/cloud.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "phyxel/neighbourhood.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/shapes.hpp"
#include "phyxel/solver.hpp"
#include "phyxel/state.hpp"
#include "phyxel/stretches.hpp"
#include "phyxel/types.hpp"

// Which materials a learned network was taught. It sees a particle's type alone, so that a scene's sand is the
// training's sand to it, whatever its friction angle.
#pragma once

#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "nn/weights.h"

namespace graupel::experiments {

/// A line for every material of the scene that is not that of the training: "sand: friction_angle is 33, of the
/// training 45". None for weights that do not say (metadata training.materials).
std::vector<std::string> unlike_training(const nn::Weights& weights, const Scene& scene);

/// A line for walls and one for obstacles with friction: contact with them is what the network saw in training, and no
/// weights so far name friction there. A line for each kind of thing that changes, which no training has
/// (graph::check_training_scene). None for weights that do not say what they were taught.
std::vector<std::string> unknown_walls(const nn::Weights& weights, const Scene& scene);

}  // namespace graupel::experiments

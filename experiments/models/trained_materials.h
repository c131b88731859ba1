// Which materials and surfaces a learned network was taught, and what of a scene lies outside of that.
#pragma once

#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "nn/weights.h"

namespace graupel::experiments {

/// A line for every material of the scene that is not that of the training.
/// Of weights that tell ranges (nn::TrainedBox): "outside the training: sand.friction_angle is 50, of the training 20
/// to 45", and a line for each constant that the training varied and the network has no input for. Of others a
/// network sees types alone, so that every other constant counts: "sand: friction_angle is 33, of the training 45"
/// (metadata training.materials). None for weights that do not say.
std::vector<std::string> unlike_training(const nn::Weights& weights, const Scene& scene);

/// A line for friction and for kinds of contact outside of the training, or that the network has no input for: of
/// weights that tell no ranges, those of walls and of obstacles with friction. A line for each kind of thing that
/// changes and changed in no scene of the training. None for weights that do not say what they were taught.
std::vector<std::string> unknown_walls(const nn::Weights& weights, const Scene& scene);

/// A line for loads and one for gravity that changes: no network has an input for them, whatever its training.
std::vector<std::string> unknown_forces(const Scene& scene);

/// All of these, as sentences for readers of a run.
std::vector<std::string> training_remarks(const nn::Weights& weights, const Scene& scene);

}  // namespace graupel::experiments

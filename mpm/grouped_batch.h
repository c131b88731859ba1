// A batch of scenes as several batches, each of scenes that one launch can advance.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "mpm/simulation.h"

namespace graupel::mpm {

/// Scenes in groups, by index: every scene is in one of them.
using SceneGroups = std::vector<std::vector<std::size_t>>;

/// `make` makes the batch of a group. Groups advance one after another.
template <typename Make>
std::unique_ptr<SceneBatch> make_grouped(const std::vector<PreparedScene>& scenes, const SceneGroups& groups,
                                         const Make& make);

/// The batches of the groups as one, whose scenes are in the order of the indices.
std::unique_ptr<SceneBatch> join_groups(std::vector<std::unique_ptr<SceneBatch>> batches, const SceneGroups& groups);

template <typename Make>
std::unique_ptr<SceneBatch> make_grouped(const std::vector<PreparedScene>& scenes, const SceneGroups& groups,
                                         const Make& make) {
  std::vector<std::unique_ptr<SceneBatch>> batches;
  for (const auto& group : groups) {
    std::vector<PreparedScene> members;
    members.reserve(group.size());
    for (const std::size_t scene : group) members.push_back(scenes[scene]);
    batches.push_back(make(members));
  }
  return join_groups(std::move(batches), groups);
}

}  // namespace graupel::mpm

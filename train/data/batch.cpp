#include "train/data/batch.h"

#include <algorithm>

#include "core/system/error.h"
#include "graph/features/feature_row.h"
#include "graph/topology/gns_graph.h"
#include "graph/topology/graph_topology.h"

namespace graupel::train {

namespace {

Part append(std::vector<int32_t>& indices, const std::vector<int32_t>& values) {
  const Part part{static_cast<int64_t>(indices.size()), static_cast<int64_t>(values.size())};
  indices.insert(indices.end(), values.begin(), values.end());
  return part;
}

/// Appends items 0, 1, .. by their receivers: where those of each begin, and the items.
void append_by_receiver(std::vector<int32_t>& indices, const std::vector<int32_t>& receiver, int32_t receivers,
                        Part& begins, Part& items) {
  std::vector<int32_t> begin, list;
  graph::list_by_receiver(receiver, static_cast<std::size_t>(receivers), begin, list);
  begins = append(indices, begin);
  items = append(indices, list);
}

BatchLevel join_level(const std::vector<SceneGraph>& scenes, std::size_t l, std::vector<int32_t>& indices) {
  std::vector<int32_t> edge_begin = {0}, sender, receiver, slot, reverse, parent, octant;
  int32_t first_cell = 0, first_parent = 0;
  for (const SceneGraph& scene : scenes) {
    const auto& level = scene.hierarchy.levels[l];
    const bool top = l + 1 == scene.hierarchy.levels.size();
    const auto first_edge = static_cast<std::size_t>(edge_begin.back());
    // edge_at[c][k]: number of the edge that cell c receives through slot k
    std::vector<std::array<int32_t, 6>> edge_at(level.size());
    for (std::size_t c = 0; c < level.size(); ++c) {
      for (int k = 0; k < 6; ++k) {
        const int32_t n = level.neighbor[c][static_cast<std::size_t>(k)];
        if (n < 0) continue;
        edge_at[c][static_cast<std::size_t>(k)] = static_cast<int32_t>(sender.size());
        sender.push_back(first_cell + n);
        receiver.push_back(first_cell + static_cast<int32_t>(c));
        slot.push_back(k);
      }
      edge_begin.push_back(static_cast<int32_t>(sender.size()));
      octant.push_back(level.octant[c]);
      if (!top) parent.push_back(first_parent + level.parent[c]);
    }
    // Links are mutual: the reverse edge is the one that the sender receives through the opposite slot (k ^ 1).
    for (std::size_t e = first_edge; e < sender.size(); ++e)
      reverse.push_back(
          edge_at[static_cast<std::size_t>(sender[e] - first_cell)][static_cast<std::size_t>(slot[e] ^ 1)]);
    first_cell += static_cast<int32_t>(level.size());
    if (!top) first_parent += static_cast<int32_t>(scene.hierarchy.levels[l + 1].size());
  }
  BatchLevel joined;
  joined.cells = first_cell;
  joined.edges = static_cast<int64_t>(sender.size());
  joined.edge_begin = append(indices, edge_begin);
  joined.sender = append(indices, sender);
  joined.receiver = append(indices, receiver);
  joined.slot = append(indices, slot);
  joined.reverse = append(indices, reverse);
  joined.octant = append(indices, octant);
  joined.parent = append(indices, parent);
  if (!parent.empty()) {
    append_by_receiver(indices, parent, first_parent, joined.child_begin, joined.child);
  }
  return joined;
}

/// Appends one array of every scene and returns the part that they make up.
template <typename Append>
Part join_numbers(Batch& batch, const std::vector<SceneGraph>& scenes, const Append& append_scene) {
  const auto begin = static_cast<int64_t>(batch.numbers.size());
  for (const SceneGraph& scene : scenes) append_scene(scene);
  return {begin, static_cast<int64_t>(batch.numbers.size()) - begin};
}

/// What the loss is to count.
void add_counted(Batch& batch, const std::vector<SceneGraph>& scenes) {
  std::vector<float> counted;
  for (const SceneGraph& scene : scenes)
    for (std::size_t p = 0; p < static_cast<std::size_t>(scene.moving()); ++p) {
      const bool leaves = !scene.leaves.empty() && scene.leaves[p] != 0;
      counted.push_back(leaves || graph::is_kinematic_row(scene.type_row[p]) ? 0.0f : 1.0f);
    }
  batch.uncounted = std::count(counted.begin(), counted.end(), 0.0f);
  if (batch.uncounted == 0) return;
  batch.counted = {static_cast<int64_t>(batch.numbers.size()), static_cast<int64_t>(counted.size())};
  batch.numbers.insert(batch.numbers.end(), counted.begin(), counted.end());
}

void set_target_width(Batch& batch) {
  batch.target_width = batch.particles() > 0 ? batch.target.count / batch.particles() : 0;
  GRAUPEL_ASSERT(batch.target.count == batch.particles() * batch.target_width && batch.target_width % 3 == 0);
}

void join_particles(Batch& batch, const std::vector<SceneGraph>& scenes) {
  std::vector<int32_t> type_row, cell;
  int32_t first_cell = 0;
  for (const SceneGraph& scene : scenes) {
    const auto& h = scene.hierarchy;
    GRAUPEL_ASSERT(h.cell.size() == scene.type_row.size());
    type_row.insert(type_row.end(), scene.type_row.begin(), scene.type_row.end());
    for (const auto& corners : h.cell)
      for (const int32_t c : corners) cell.push_back(first_cell + c);
    first_cell += static_cast<int32_t>(h.levels[0].size());
    batch.particle_begin.push_back(batch.particles() + static_cast<int64_t>(h.cell.size()));
  }
  batch.type_row = append(batch.indices, type_row);
  batch.cell = append(batch.indices, cell);
  append_by_receiver(batch.indices, cell, first_cell, batch.pair_begin, batch.pair);

  auto& numbers = batch.numbers;
  batch.features = join_numbers(
      batch, scenes, [&](const SceneGraph& s) { numbers.insert(numbers.end(), s.features.begin(), s.features.end()); });
  batch.weight = join_numbers(batch, scenes, [&](const SceneGraph& s) {
    for (const auto& w : s.hierarchy.weight) numbers.insert(numbers.end(), w.begin(), w.end());
  });
  batch.offset = join_numbers(batch, scenes, [&](const SceneGraph& s) {
    for (const auto& o : s.hierarchy.offset) numbers.insert(numbers.end(), o.a, o.a + 3);
  });
  batch.target = join_numbers(
      batch, scenes, [&](const SceneGraph& s) { numbers.insert(numbers.end(), s.target.begin(), s.target.end()); });
  const int64_t n = batch.particles();
  batch.feature_width = n > 0 ? batch.features.count / n : 0;
  GRAUPEL_ASSERT(batch.features.count == n * batch.feature_width);
  set_target_width(batch);
}

/// Numbers of a scene's particles in the batch: moving particles of all scenes first, then those of obstacles.
class RowMap {
 public:
  RowMap(const SceneGraph& scene, int64_t first_moving, int64_t first_obstacle)
      : moving_(scene.moving()), first_moving_(first_moving), shift_(first_obstacle - scene.moving()) {}
  int32_t operator()(int32_t row) const { return static_cast<int32_t>(row + (row < moving_ ? first_moving_ : shift_)); }

 private:
  int64_t moving_, first_moving_, shift_;
};

/// Edges of all scenes by receiver. The receivers of a scene are two runs of the batch's rows, so their edges are, too.
struct JoinedLinks {
  std::vector<int32_t> begin = {0}, sender, receiver, reverse;
  std::vector<float> features;

  void add(const SceneGraph& scene, const RowMap& row, int32_t first, int32_t last, std::vector<int32_t>& place) {
    for (int32_t r = first; r < last; ++r) {
      for (int32_t e = scene.links.begin[static_cast<std::size_t>(r)];
           e < scene.links.begin[static_cast<std::size_t>(r) + 1]; ++e) {
        place[static_cast<std::size_t>(e)] = static_cast<int32_t>(sender.size());
        sender.push_back(row(scene.links.sender[static_cast<std::size_t>(e)]));
        receiver.push_back(row(r));
        const float* feature = scene.edge_features.data() + static_cast<std::size_t>(e) * graph::edge_feature_count;
        features.insert(features.end(), feature, feature + graph::edge_feature_count);
      }
      begin.push_back(static_cast<int32_t>(sender.size()));
    }
  }
  /// `place` of a scene's edges in the batch.
  void add_reverse(const SceneGraph& scene, const std::vector<int32_t>& place) {
    reverse.resize(sender.size());
    const auto& links = scene.links;
    for (int32_t r = 0; r < links.points(); ++r)
      for (int32_t e = links.begin[static_cast<std::size_t>(r)]; e < links.begin[static_cast<std::size_t>(r) + 1];
           ++e) {
        const auto s = static_cast<std::size_t>(links.sender[static_cast<std::size_t>(e)]);
        const auto first = links.sender.begin() + links.begin[s], last = links.sender.begin() + links.begin[s + 1];
        const auto back = std::lower_bound(first, last, r);
        GRAUPEL_ASSERT(back != last && *back == r);
        reverse[static_cast<std::size_t>(place[static_cast<std::size_t>(e)])] =
            place[static_cast<std::size_t>(back - links.sender.begin())];
      }
  }
};

/// Links between particles; `batch` gets their features.
BatchLevel join_links(Batch& batch, const std::vector<SceneGraph>& scenes) {
  int64_t first_moving = 0, first_obstacle = batch.particles();
  std::vector<RowMap> rows;
  std::vector<std::vector<int32_t>> place;
  for (const SceneGraph& scene : scenes) {
    rows.emplace_back(scene, first_moving, first_obstacle);
    place.emplace_back(scene.links.sender.size());
    first_moving += scene.moving();
    first_obstacle += scene.obstacle_particles;
  }
  JoinedLinks joined;
  for (std::size_t s = 0; s < scenes.size(); ++s)
    joined.add(scenes[s], rows[s], 0, static_cast<int32_t>(scenes[s].moving()), place[s]);
  for (std::size_t s = 0; s < scenes.size(); ++s)
    joined.add(scenes[s], rows[s], static_cast<int32_t>(scenes[s].moving()), scenes[s].links.points(), place[s]);
  for (std::size_t s = 0; s < scenes.size(); ++s) joined.add_reverse(scenes[s], place[s]);
  BatchLevel level;
  level.cells = first_obstacle;
  level.edges = static_cast<int64_t>(joined.sender.size());
  level.edge_begin = append(batch.indices, joined.begin);
  level.sender = append(batch.indices, joined.sender);
  level.receiver = append(batch.indices, joined.receiver);
  level.reverse = append(batch.indices, joined.reverse);
  while (batch.numbers.size() % graph::edge_feature_count != 0) batch.numbers.push_back(0);  // kernels load all at once
  batch.edge_features = {static_cast<int64_t>(batch.numbers.size()), static_cast<int64_t>(joined.features.size())};
  batch.numbers.insert(batch.numbers.end(), joined.features.begin(), joined.features.end());
  return level;
}

/// Particles, obstacle particles and links of GNS.
Batch concatenate_gns(const std::vector<SceneGraph>& scenes) {
  Batch batch;
  std::vector<int32_t> type_row;
  int64_t rows = 0;
  for (const SceneGraph& scene : scenes) {
    GRAUPEL_ASSERT(scene.links.points() == static_cast<int32_t>(scene.type_row.size()));
    batch.particle_begin.push_back(batch.particles() + scene.moving());
    rows += static_cast<int64_t>(scene.type_row.size());
  }
  const auto width_of = [](const SceneGraph& scene) {
    return scene.type_row.empty() ? 0 : scene.features.size() / scene.type_row.size();
  };
  auto& numbers = batch.numbers;
  for (const bool obstacles : {false, true})
    for (const SceneGraph& scene : scenes) {
      const auto moving = static_cast<std::ptrdiff_t>(scene.moving());
      const auto cut = scene.features.begin() + moving * static_cast<std::ptrdiff_t>(width_of(scene));
      numbers.insert(numbers.end(), obstacles ? cut : scene.features.begin(), obstacles ? scene.features.end() : cut);
      type_row.insert(type_row.end(), scene.type_row.begin() + (obstacles ? moving : 0),
                      obstacles ? scene.type_row.end() : scene.type_row.begin() + moving);
    }
  batch.features = {0, static_cast<int64_t>(numbers.size())};
  batch.type_row = append(batch.indices, type_row);
  batch.target = join_numbers(
      batch, scenes, [&](const SceneGraph& s) { numbers.insert(numbers.end(), s.target.begin(), s.target.end()); });
  batch.feature_width = rows > 0 ? batch.features.count / rows : 0;
  GRAUPEL_ASSERT(batch.features.count == rows * batch.feature_width);
  set_target_width(batch);
  batch.level.push_back(join_links(batch, scenes));
  return batch;
}

}  // namespace

Batch concatenate(const std::vector<SceneGraph>& scenes) {
  GRAUPEL_ASSERT(!scenes.empty());
  const std::size_t levels = scenes.front().hierarchy.levels.size();
  if (levels == 0) {
    Batch batch = concatenate_gns(scenes);
    add_counted(batch, scenes);
    return batch;
  }
  std::size_t particles = 0;
  for (const SceneGraph& scene : scenes) {
    GRAUPEL_ASSERT(scene.hierarchy.levels.size() == levels);
    particles += scene.type_row.size();
  }
  Batch batch;
  batch.numbers.reserve(particles * 48);
  batch.indices.reserve(particles * 32);
  join_particles(batch, scenes);
  for (std::size_t l = 0; l < levels; ++l) batch.level.push_back(join_level(scenes, l, batch.indices));
  add_counted(batch, scenes);
  return batch;
}

}  // namespace graupel::train

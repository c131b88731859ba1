// Writes the seeds that no editor can: weights of every kind, a saved run, scenes with every key. graupel_fuzz_seeds
// tests/fuzz/corpus
#include <algorithm>
#include <filesystem>
#include <string>

#include "core/system/atomic_file.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/state_file.h"
#include "nn/weights.h"
#include "tests/fuzz/seed_models.h"
#include "tests/graph/random_weights.h"
#include "tests/mpm/changing_scenes.h"

namespace graupel::fuzz {

namespace {

template <typename Config>
void write_network(const std::string& file, Config config) {
  config.latent = 8;
  config.embedding = 1;
  config.history = 1;
  config.message_passing = 1;
  config.dx = 1.0 / 16;
  config.signed_distance = true;
  nn::write_safetensors(file, graph::random_weights(config, graph::Normalization()));
}

void write_state(const std::string& file) {
  io::SavedRun run;
  run.version = "graupel 0.1.0";
  run.device = "cpu";
  run.precision = "f32";
  run.frame = 2;
  run.particles = 3;
  run.scene_json = io::scene_to_json(seed_scene());
  run.output = "out.h5";
  run.active = run.forces = true;
  run.fields = {ParticleField::plastic};
  ParticleFrame frame;
  frame.position.assign(3, {0.5f, 0.4f, 0.3f});
  frame.velocity.assign(3, {0, -1, 0});
  frame.active.assign(3, 1);
  frame.fields[ParticleField::plastic].assign(3, 0.5f);
  run.recent = {frame, frame};
  run.state.assign(40, std::byte{7});
  io::write_state_file(file, run);
}

/// Every key is there, so that every one is changed.
void write_scene(const std::string& file, Scene scene) {
  for (Source& source : scene.sources) source.particles_per_cell = 1;
  write_file_atomically(file, io::scene_to_json(scene));
}

void write_scenes(const std::string& folder) {
  std::filesystem::create_directories(folder);
  for (auto [name, scene] : mpm::changing_scenes()) {
    std::replace(name.begin(), name.end(), ' ', '_');
    write_scene(folder + "/" + name + ".json", scene);
  }
  write_scene(folder + "/every_model.json", mpm::every_model());
  write_scene(folder + "/in_the_plane.json", mpm::in_the_plane(mpm::scene_with("taichi_sand", {0.4, 0.1, 0.4}, 0.06)));
}

void write_seeds(const std::string& corpus) {
  const std::string weights = corpus + "/safetensors/";
  std::filesystem::create_directories(weights);
  std::filesystem::create_directories(corpus + "/state_file");
  graph::HgnConfig hgn;
  hgn.levels = 2;
  write_network(weights + "hgn_messages", hgn);
  hgn.levels = 1;
  hgn.aggregation = graph::Aggregation::activations;
  hgn.bundle = 2;
  hgn.material_constants = hgn.contact = true;
  write_network(weights + "hgn_activations", hgn);
  graph::GnsConfig gns;
  write_network(weights + "gns", gns);
  gns.hidden_layers = 2;
  gns.obstacle_particles = true;
  gns.obstacle_spacing = 0.1;
  gns.cell_normal = false;
  write_network(weights + "gns_obstacle_particles", gns);
  for (const auto& [name, model] : seed_models()) nn::write_safetensors(weights + name, model.store(nn::DType::f16));
  write_state(corpus + "/state_file/run");
  write_scenes(corpus + "/scene");
}

}  // namespace

}  // namespace graupel::fuzz

int main(int count, char** words) {
  if (count != 2) return 2;
  graupel::fuzz::write_seeds(words[1]);
  return 0;
}

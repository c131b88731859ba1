#include "compare/report/player_section.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string_view>

#include "compare/report/base64.h"
#include "compare/report_assets.h"

namespace graupel::compare {

namespace {

using Json = nlohmann::ordered_json;

template <typename T>
std::string_view bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::string data_block(const std::string& id, std::string_view bytes) {
  return "<script type=\"text/plain\" id=\"" + id + "\">" + encode_base64(bytes) + "</script>\n";
}

Json vector_json(const Vec3d& v) { return {v[0], v[1], v[2]}; }

/// Index of the player's data as JSON, and the data blocks.
std::string player_data(const Comparison& comparison) {
  Json scenes = Json::array();
  std::string blocks;
  int number = 0;
  const auto add_track = [&](const PlayerTrack& track) {
    const std::string id = fmt::format("d{}", number++);
    blocks += data_block(id + "p", bytes_of(track.position)) + data_block(id + "t", bytes_of(track.type));
    return Json{{"id", id},
                {"label", track.label},
                {"particles", track.particles},
                {"allParticles", track.all_particles},
                {"frames", track.frames},
                {"radius", track.radius}};
  };
  for (const SceneResult& scene : comparison.scenes) {
    Json tracks = Json::array({add_track(scene.truth)});
    for (const ModelResult& result : scene.models) tracks.push_back(add_track(result.track));
    const std::string id = fmt::format("d{}", number++);
    blocks += data_block(id + "p", bytes_of(scene.obstacles.position));
    blocks += data_block(id + "n", bytes_of(scene.obstacles.normal));
    scenes.push_back(
        {{"name", scene.name},
         {"low", vector_json(scene.low)},
         {"size", vector_json(scene.size)},
         {"up", vector_json(scene.up)},
         {"frames", scene.frames},
         {"frameTime", scene.frame_time},
         {"obstacles",
          {{"id", id}, {"points", scene.obstacles.position.size() / 3}, {"radius", scene.obstacles.radius}}},
         {"tracks", tracks}});
  }
  std::string text = Json{{"scenes", scenes}}.dump();
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) text.replace(at, 1, "\\u003c");
  return "<script type=\"application/json\" id=\"player-index\">" + text + "</script>\n" + blocks;
}

}  // namespace

std::string player_section(const Comparison& comparison) {
  return R"(<h2>Particles in motion</h2>
<div id="player">
<div class="bar"><label>Scene <select id="player-scene"></select></label>
<label>Model on the right <select id="player-model"></select></label>
<button id="player-play">Play</button>
<input type="range" id="player-scrub" min="0" max="1" step="0.25" value="0" aria-label="frame">
<span id="player-time"></span></div>
<div class="sides"><span>truth</span><span id="player-right"></span></div>
<canvas id="player-canvas"></canvas>
<p class="soft" id="player-message">Drag to orbit, wheel to zoom.</p>
<p class="soft" id="player-note"></p>
</div>
)" + player_data(comparison) +
         "<script>\n" + player_script + "</script>\n";
}

}  // namespace graupel::compare

#include "train/config/presets.h"

namespace graupel::train {

std::vector<std::string> preset_settings(Architecture architecture, Preset preset) {
  const bool hgn = architecture == Architecture::hgn;
  if (preset == Preset::paper) {
    std::vector<std::string> settings = {"batch_scenes=1", "ema_decay=0"};
    if (hgn) settings.emplace_back("jitter=finest");
    return settings;
  }
  std::vector<std::string> settings = {"symmetries=true", "noise_std=6e-4", "schedule=cosine", "warm_up_steps=200",
                                       "clip_norm=5"};
  const std::vector<std::string> own =
      hgn ? std::vector<std::string>{"hgn.aggregation=activations", "hgn.message_passing=2",
                                     "hgn.signed_distance=true",    "batch_scenes=16",
                                     "learning_rate=8e-4",          "ema_decay=0.9995"}
          : std::vector<std::string>{"batch_scenes=4", "learning_rate=3e-4"};
  settings.insert(settings.end(), own.begin(), own.end());
  return settings;
}

}  // namespace graupel::train

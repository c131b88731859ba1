#include "experiments/process/convert_file.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/input_files.h"
#include "nn/number_width.h"

namespace graupel::experiments {

namespace {

void convert_weights(const FileConversion& c) {
  if (c.numbers.empty())
    throw ConfigError("'" + c.input + "' holds weights, which need --numbers (allowed: f32, f16, bf16, i8). Give one");
  nn::Weights weights = nn::read_safetensors(c.input);
  nn::set_number_width(weights, c.numbers, c.keep);
  nn::write_safetensors(c.output, weights);
  std::fprintf(stderr, "%s: %zu tensors in %s\n", c.output.c_str(), weights.tensors.size(), c.numbers.c_str());
}

}  // namespace

void convert_file(FileConversion& conversion) {
  const FileConversion& c = conversion;
  conversion.common.apply();
  check_output_file(c.output);
  io::check_inputs_kept({{"the input", c.input}}, {{"the output", c.output}, {"--json", c.common.json}}, c.set);
  const bool weights = c.input.ends_with(".safetensors");
  if (weights)
    convert_weights(c);
  else
    write_file_atomically(c.output, io::scene_to_json(io::read_scene(c.input, c.set)));
  c.common.write_json({{"output", c.output}, {"kind", weights ? "weights" : "scene"}});
}

}  // namespace graupel::experiments

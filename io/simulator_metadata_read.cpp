// Reading and checking metadata.json.
#include <algorithm>
#include <cmath>

#include "core/atomic_file.h"
#include "core/error.h"
#include "io/json_node.h"
#include "io/simulator_metadata.h"

namespace graupel::io {

namespace {

constexpr std::size_t most_bytes = std::size_t(16) << 20;

std::string short_text(const JsonNode& node) {
  std::string text = write_json(node, JsonLayout::compact);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

class MetadataReader {
 public:
  MetadataReader(std::string file, const JsonNode& root) : file_(std::move(file)), root_(root) {}

  SimulatorMetadata read() {
    SimulatorMetadata out;
    if (const JsonNode* name = root_.find("case"); name && name->kind == JsonNode::Kind::string) out.name = name->text;
    out.dimensions = static_cast<int>(whole("dim", 2, 3));
    axes_ = static_cast<std::size_t>(out.dimensions);
    out.bounds = bounds();
    out.periodic = periodic();
    const JsonNode* every = root_.find("write_every");
    out.frame_time = positive("dt") * static_cast<double>(every ? whole("write_every", 1, 1'000'000'000) : 1);
    out.connectivity_radius = positive("default_connectivity_radius");
    check_lengths();
    out.motion = {vector("vel_mean", Least::none), vector("vel_std", Least::zero), vector("acc_mean", Least::none),
                  vector("acc_std", Least::zero)};
    if (root_.find("dx")) out.particle_spacing = positive("dx");
    if (root_.find("grid_spacing")) out.grid_spacing = positive("grid_spacing");
    if (root_.find("gravity")) out.gravity = gravity();
    return out;
  }

 private:
  enum class Least { none, zero };

  [[noreturn]] void fail(const std::string& key, const std::string& found, const std::string& wanted) const {
    const JsonNode* node = root_.find(key);
    const std::string line = node && node->line > 0 ? ":" + std::to_string(node->line) : "";
    throw InputError("'" + file_ + line + "': '" + key + "' " + found + " (needed: " + wanted + "). Correct the file");
  }
  const JsonNode& need(const std::string& key, const std::string& wanted) const {
    const JsonNode* node = root_.find(key);
    if (!node) fail(key, "is missing", wanted);
    return *node;
  }
  static bool is_finite(const JsonNode& node) { return node.is_number() && std::isfinite(node.as_double()); }

  int64_t whole(const std::string& key, int64_t low, int64_t high) const {
    const std::string wanted = "a whole number from " + std::to_string(low) + " to " + std::to_string(high);
    const JsonNode& node = need(key, wanted);
    if (!is_finite(node) || node.as_double() != std::floor(node.as_double()) ||
        node.as_double() < static_cast<double>(low) || node.as_double() > static_cast<double>(high))
      fail(key, "is " + short_text(node), wanted);
    return static_cast<int64_t>(node.as_double());
  }
  double positive(const std::string& key) const {
    const JsonNode& node = need(key, "a number above 0");
    if (!is_finite(node) || !(node.as_double() > 0)) fail(key, "is " + short_text(node), "a number above 0");
    return node.as_double();
  }
  std::vector<double> vector(const std::string& key, Least least) const {
    const std::string wanted =
        std::to_string(axes_) + (least == Least::zero ? " numbers, 0 or more, as dim says" : " numbers, as dim says");
    const JsonNode& node = need(key, wanted);
    std::vector<double> values;
    for (const JsonNode& item : node.items) {
      if (!is_finite(item) || (least == Least::zero && item.as_double() < 0)) break;
      values.push_back(item.as_double());
    }
    if (node.kind != JsonNode::Kind::array || node.items.size() != axes_ || values.size() != axes_)
      fail(key, "is " + short_text(node), wanted);
    return values;
  }

  std::vector<std::array<double, 2>> bounds() const {
    const std::string wanted = std::to_string(axes_) + " pairs [low, high], low below high, as dim says";
    const JsonNode& node = need("bounds", wanted);
    std::vector<std::array<double, 2>> out;
    for (const JsonNode& pair : node.items) {
      const auto& ends = pair.items;
      if (ends.size() != 2 || !is_finite(ends[0]) || !is_finite(ends[1]) ||
          !(ends[0].as_double() < ends[1].as_double()))
        fail("bounds", "is " + short_text(node), wanted);
      out.push_back({ends[0].as_double(), ends[1].as_double()});
    }
    if (out.size() != axes_) fail("bounds", "is " + short_text(node), wanted);
    return out;
  }

  /// Some of LagrangeBench's data sets of two dimensions list three.
  std::vector<bool> periodic() const {
    const std::string key = "periodic_boundary_conditions";
    const JsonNode* node = root_.find(key);
    if (!node) return std::vector<bool>(axes_, false);
    std::vector<bool> out;
    for (const JsonNode& item : node->items) {
      if (item.kind != JsonNode::Kind::boolean) break;
      out.push_back(item.boolean);
    }
    if (out.size() != node->items.size() || (out.size() != axes_ && out.size() != 3))
      fail(key, "is " + short_text(*node), std::to_string(axes_) + " times true or false, as dim says");
    out.resize(axes_);
    return out;
  }

  /// Numbers of frames are known from the data; these only must be numbers, or null.
  void check_lengths() const {
    for (const auto& member : root_.members)
      if (member.key.starts_with("sequence_length") && member.value.kind != JsonNode::Kind::null)
        whole(member.key, 1, int64_t(1) << 31);
  }

  std::array<double, 3> gravity() const {
    const JsonNode& node = *root_.find("gravity");
    const bool good = node.items.size() == 3 && std::all_of(node.items.begin(), node.items.end(), is_finite);
    if (!good) fail("gravity", "is " + short_text(node), "3 numbers");
    return {node.items[0].as_double(), node.items[1].as_double(), node.items[2].as_double()};
  }

  std::string file_;
  const JsonNode& root_;
  std::size_t axes_ = 3;
};

}  // namespace

SimulatorMetadata read_simulator_metadata(const std::string& file) {
  JsonNode root;
  try {
    root = parse_json(read_file(file, most_bytes), file);
  } catch (const ConfigError& error) {
    throw InputError(error.what());
  }
  const JsonNode* train = root.find("train");
  const JsonNode& part = train && train->kind == JsonNode::Kind::object ? *train : root;
  return MetadataReader(file, part).read();
}

}  // namespace graupel::io

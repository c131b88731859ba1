#include "io/scene/sweep_draw.h"

#include <iterator>
#include <numeric>

#include "core/math/random.h"
#include "core/system/error.h"

namespace graupel::io {

namespace {

constexpr int64_t primes[] = {2, 3, 5, 7, 11, 13, 17, 19};
/// Beyond it the first points of neighbouring primes lie on lines.
constexpr std::size_t most_parameters = 6;

using Points = std::vector<std::vector<double>>;  ///< [runs][parameters] in [0, 1]

ConfigPlace parameter_place(const ConfigDocument& document, std::size_t parameter, std::vector<std::string> keys = {}) {
  keys.insert(keys.begin(), {"parameters", std::to_string(parameter)});
  return find_place(document, keys);
}

Points points_of(const SweepDraw& draw, std::size_t parameters) {
  Points points;
  const auto corners = int64_t{1} << parameters;
  for (int64_t run = 0; run < draw.train; ++run) {
    std::vector<double>& point = points.emplace_back();
    for (std::size_t p = 0; p < parameters; ++p)
      point.push_back(run < corners ? static_cast<double>(run >> p & 1) : halton(run - corners + 1, p));
  }
  const auto add_random = [&](int64_t runs, uint64_t stream) {
    const Random random(draw.seed, RandomPurpose::scene_layout, stream);
    for (int64_t run = 0; run < runs; ++run) {
      std::vector<double>& point = points.emplace_back();
      for (std::size_t p = 0; p < parameters; ++p)
        point.push_back(random.uniform(static_cast<uint64_t>(run) * most_parameters + p));
    }
  };
  add_random(draw.valid, 1);
  add_random(draw.test, 2);
  return points;
}

/// a + t (b - a) of two numbers, or of two lists of them of one length.
JsonNode between(const ConfigPlace& place, const JsonNode& a, const JsonNode& b, double t) {
  if (a.is_number() && b.is_number()) return JsonNode::of(a.as_double() + t * (b.as_double() - a.as_double()));
  if (a.kind != JsonNode::Kind::array || b.kind != JsonNode::Kind::array || a.items.size() != b.items.size())
    config_fail(place, "is not two numbers or two vectors of one length (" + place.value() + ")",
                "Give the key's values at the two ends of the parameter's range");
  JsonNode list = JsonNode::array();
  for (std::size_t i = 0; i < a.items.size(); ++i) list.items.push_back(between(place, a.items[i], b.items[i], t));
  return list;
}

void fill_follower(const ConfigPlace& place, const Points& points, std::size_t parameter, SweepFollower& follower) {
  if (follower.range.size() != 2)
    config_fail(place, "needs two values, and has " + std::to_string(follower.range.size()),
                "Give the key's values at the two ends of the parameter's range");
  const JsonNode low = parse_json(follower.range[0].json, "range"), high = parse_json(follower.range[1].json, "range");
  for (const std::vector<double>& point : points)
    follower.values.push_back({write_json(between(place, low, high, point[parameter]), JsonLayout::compact)});
  follower.range.clear();
}

void check_no_ranges(const ConfigDocument& document, const SweepRecipe& recipe) {
  const auto refuse = [](const ConfigPlace& place) {
    config_fail(place, "has no effect without 'draw'", "Give 'values', or draw the runs: \"draw\": {\"train\": 32}");
  };
  for (std::size_t p = 0; p < recipe.parameters.size(); ++p) {
    const SweepParameter& parameter = recipe.parameters[p];
    if (parameter.range != Interval{}) refuse(parameter_place(document, p, {"range"}));
    for (std::size_t a = 0; a < parameter.also.size(); ++a)
      if (!parameter.also[a].range.empty()) refuse(parameter_place(document, p, {"also", std::to_string(a), "range"}));
  }
}

void check_draw(const ConfigDocument& document, const SweepRecipe& recipe) {
  const std::size_t n = recipe.parameters.size();
  if (n > most_parameters)
    config_fail(
        find_place(document, {"parameters"}),
        "are too many for 'draw' (" + std::to_string(n) + ", allowed 1 to " + std::to_string(most_parameters) + ")",
        "Vary fewer, or list the values");
  const int64_t corners = int64_t{1} << n;
  if (recipe.draw.train > 0 && recipe.draw.train < corners)
    config_fail(find_place(document, {"draw", "train"}),
                "is less than the corners of the box (" + std::to_string(recipe.draw.train) +
                    ", allowed 0, or at least " + std::to_string(corners) + " with " + std::to_string(n) +
                    " parameters)",
                "Raise it, or vary fewer parameters");
  for (const auto& [name, list] : {std::pair("test", &recipe.test), std::pair("valid", &recipe.valid)})
    if (!list->empty())
      config_fail(find_place(document, {name}), "names runs, and 'draw' draws them",
                  "Give their number instead: draw." + std::string(name));
}

}  // namespace

double halton(int64_t index, std::size_t dimension) {
  GRAUPEL_ASSERT(dimension < std::size(primes));
  const int64_t base = primes[dimension];
  double value = 0, digit = 1;
  for (; index > 0; index /= base) {
    digit /= static_cast<double>(base);
    value += digit * static_cast<double>(index % base);
  }
  return value;
}

void draw_runs(const ConfigDocument& document, SweepRecipe& recipe) {
  if (!recipe.draw.is_set()) return check_no_ranges(document, recipe);
  check_draw(document, recipe);
  const Points points = points_of(recipe.draw, recipe.parameters.size());
  for (std::size_t p = 0; p < recipe.parameters.size(); ++p) {
    SweepParameter& parameter = recipe.parameters[p];
    if (!parameter.values.empty())
      config_fail(parameter_place(document, p, {"values"}), "has no effect beside 'draw'", "Give 'range' instead");
    if (!(parameter.range.low < parameter.range.high))
      config_fail(parameter_place(document, p, {"range"}), "is missing or empty, and 'draw' needs it",
                  "Give the least and the greatest value: \"range\": [low, high]");
    for (const std::vector<double>& point : points)
      parameter.values.push_back(parameter.range.low + point[p] * (parameter.range.high - parameter.range.low));
    parameter.range = {};
    for (std::size_t a = 0; a < parameter.also.size(); ++a) {
      const std::string number = std::to_string(a);
      if (!parameter.also[a].values.empty())
        config_fail(parameter_place(document, p, {"also", number, "values"}), "has no effect beside 'draw'",
                    "Give 'range' instead");
      fill_follower(parameter_place(document, p, {"also", number, "range"}), points, p, parameter.also[a]);
    }
  }
  recipe.valid.resize(static_cast<std::size_t>(recipe.draw.valid));
  std::iota(recipe.valid.begin(), recipe.valid.end(), recipe.draw.train);
  recipe.test.resize(static_cast<std::size_t>(recipe.draw.test));
  std::iota(recipe.test.begin(), recipe.test.end(), recipe.draw.train + recipe.draw.valid);
  recipe.draw = {};
}

}  // namespace graupel::io

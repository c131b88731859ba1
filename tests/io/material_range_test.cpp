// Every parameter of a material, on either side of its range, for every model that has it: the error names the file,
// the pointer, the value, what is allowed and a remedy.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "core/scene/material_config.h"
#include "core/system/error.h"
#include "expect_error.h"
#include "io/scene/scene_reader.h"

namespace graupel::io {
namespace {

struct Parameter {
  std::string name, models;
  Range range;
};

/// The numbers among the keys of a material.
std::vector<Parameter> numbers_of_materials() {
  std::vector<Parameter> numbers;
  MaterialConfig::fields([&](auto member, const FieldInfo& info) {
    if constexpr (std::is_same_v<decltype(member), double MaterialConfig::*>)
      numbers.push_back({std::string(info.name), std::string(info.only_for), info.range});
  });
  return numbers;
}

std::vector<std::string> models_with(const Parameter& parameter) {
  std::vector<std::string> models;
  if (parameter.models == "tait") return {"\"water\", \"equation_of_state\": \"tait\""};
  std::istringstream words(parameter.models.empty() ? "water sand" : parameter.models);
  for (std::string word; words >> word;) models.push_back("\"" + word + "\"");
  return models;
}

std::string scene_with(const std::string& model, const std::string& key, const std::string& value) {
  return "{\"domain\": {\"dx\": 0.02}, \"materials\": {\"stuff\": {\"model\": " + model + ", \"" + key +
         "\": " + value +
         "}}, \"sources\": [{\"shape\": \"box\", \"size\": [0.1, 0.1, 0.1], \"material\": \"stuff\", \"position\": "
         "[0.5, 0.5, "
         "0.5]}]}";
}

std::string text_of(double value) {
  std::ostringstream text;
  text.precision(17);
  text << value;
  return text.str();
}

/// Values just outside the range, and two that are no numbers.
std::vector<std::string> bad_values(const Range& range) {
  std::vector<std::string> values = {"\"stiff\"", "null"};
  if (std::isfinite(range.low)) values.push_back(text_of(range.low_open ? range.low : range.low - 1));
  if (std::isfinite(range.high)) values.push_back(text_of(range.high_open ? range.high : range.high + 1));
  return values;
}

TEST(MaterialRange, EveryParameterOutsideItsRangeIsRefused) {
  const auto parameters = numbers_of_materials();
  ASSERT_GE(parameters.size(), 16u);
  for (const Parameter& parameter : parameters) {
    EXPECT_TRUE(std::isfinite(parameter.range.low)) << parameter.name << " has no lower bound";
    for (const std::string& model : models_with(parameter))
      for (const std::string& value : bad_values(parameter.range)) {
        SCOPED_TRACE(model + " " + parameter.name + " " + value);
        expect_error<ConfigError>([&] { parse_scene(scene_with(model, parameter.name, value), "s.json", "/"); },
                                  {"s.json:1", "/materials/stuff/" + parameter.name, ". "});
      }
  }
}

TEST(MaterialRange, TheErrorNamesValueRangeAndRemedy) {
  const auto fails = [](const std::string& model, const std::string& key, const std::string& value,
                        const std::string& allowed) {
    expect_error<ConfigError>([&] { parse_scene(scene_with(model, key, value), "s.json", "/"); },
                              {"/materials/stuff/" + key, "(" + value, "allowed " + allowed, "Change the value"});
  };
  for (const char* model : {"\"jelly\"", "\"sand\"", "\"neo_hookean\"", "\"metal\"", "\"foam\""}) {
    fails(model, "poissons_ratio", "0.5", ">= 0 and < 0.5");
    fails(model, "poissons_ratio", "-0.1", ">= 0 and < 0.5");
    fails(model, "youngs_modulus", "-1", "> 0");
  }
  fails("\"water\"", "bulk_modulus", "0", "> 0");
  fails("\"water\"", "density", "-1000", "> 0");
  fails("\"sand\"", "friction_angle", "90", ">= 0 and < 90");
  fails("\"metal\"", "yield_stress", "-5", ">= 0");
}

TEST(MaterialRange, AParameterOfAnotherModelIsRefused) {
  expect_error<ConfigError>([] { parse_scene(scene_with("\"water\"", "friction_angle", "30"), "s.json", "/"); },
                            {"/materials/stuff/friction_angle", "water"});
}

}  // namespace
}  // namespace graupel::io

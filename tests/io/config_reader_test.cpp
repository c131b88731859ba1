#include "io/config/config_reader.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/config/config_description.h"

namespace graupel::io {
namespace {

enum class Engine { steam, wind };

}  // namespace
}  // namespace graupel::io

template <>
struct graupel::EnumWords<graupel::io::Engine> {
  static constexpr std::pair<const char*, graupel::io::Engine> words[] = {{"steam", graupel::io::Engine::steam},
                                                                          {"wind", graupel::io::Engine::wind}};
};

namespace graupel::io {
namespace {

struct Wheel {
  double radius = 0.3;
  template <typename Visitor>
  static void fields(Visitor&& visit) {
    visit(&Wheel::radius,
          FieldInfo{.name = "radius", .unit = "m", .meaning = "Radius", .range = Range::positive(), .required = true});
  }
};

/// One field of each type that core/scene/fields.h lists.
struct Machine {
  Engine engine = Engine::steam;
  double pressure = 2;
  double sail = 5;
  bool loud = true;
  int64_t crew = 3;
  uint64_t serial = 1;
  std::string owner = "none";
  Vec3d place = {0, 0, 0};
  std::optional<double> weight;
  Wheel spare;
  std::vector<Wheel> wheels;
  std::vector<double> gears = {1, 2};
  std::map<std::string, Wheel> drawer;
  AnyValue cargo;
  std::map<std::string, AnyValue> notes;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using M = Machine;
    visit(&M::engine, FieldInfo{.name = "engine", .unit = "", .meaning = "Drive"});
    visit(&M::pressure, FieldInfo{.name = "pressure",
                                  .unit = "Pa",
                                  .meaning = "Boiler pressure",
                                  .range = Range::positive(),
                                  .only_for = "steam"});
    visit(&M::sail, FieldInfo{.name = "sail", .unit = "m^2", .meaning = "Sail", .required = true, .only_for = "wind"});
    visit(&M::loud, FieldInfo{.name = "loud", .unit = "", .meaning = "Noise"});
    visit(&M::crew, FieldInfo{.name = "crew", .unit = "", .meaning = "People", .range = Range::between(1, 9)});
    visit(&M::serial, FieldInfo{.name = "serial", .unit = "", .meaning = "Number"});
    visit(&M::owner, FieldInfo{.name = "owner", .unit = "", .meaning = "Owner"});
    visit(&M::place, FieldInfo{.name = "place", .unit = "m", .meaning = "Place", .range = Range::between(-10, 10)});
    visit(&M::weight, FieldInfo{.name = "weight", .unit = "kg", .meaning = "Weight", .range = Range::positive()});
    visit(&M::spare, FieldInfo{.name = "spare", .unit = "", .meaning = "Spare wheel"});
    visit(&M::wheels, FieldInfo{.name = "wheels", .unit = "", .meaning = "Wheels"});
    visit(&M::gears, FieldInfo{.name = "gears", .unit = "", .meaning = "Ratios", .range = Range::positive()});
    visit(&M::drawer, FieldInfo{.name = "drawer", .unit = "", .meaning = "Spares by name"});
    visit(&M::cargo, FieldInfo{.name = "cargo", .unit = "", .meaning = "Whatever it is"});
    visit(&M::notes, FieldInfo{.name = "notes", .unit = "", .meaning = "Remarks by subject"});
  }
};

Machine read(const std::string& text, const std::vector<std::string>& overrides = {}) {
  return read_config<Machine>(text, "machine.json", overrides);
}

TEST(ConfigReader, ReadsEveryType) {
  const Machine m = read(R"({"engine": "wind", "sail": 7.5, "loud": false, "crew": 4, "serial": 18446744073709551615,
    "owner": "Ada", "place": [1, 2.5, -3], "weight": 1e3, "spare": {"radius": 1}, "wheels": [{"radius": 2}, {"radius": 3}],
    "gears": [4], "drawer": {"a b": {"radius": 5}}, "cargo": [1, {"x": "y"}], "notes": {"a.b": null, "c": -2.5}, "$schema": "machine.schema.json"})");
  EXPECT_EQ(m.engine, Engine::wind);
  EXPECT_EQ(m.sail, 7.5);
  EXPECT_FALSE(m.loud);
  EXPECT_EQ(m.crew, 4);
  EXPECT_EQ(m.serial, ~uint64_t(0));
  EXPECT_EQ(m.owner, "Ada");
  EXPECT_EQ(m.place, (Vec3d{1, 2.5, -3}));
  EXPECT_EQ(m.weight, 1000);
  EXPECT_EQ(m.spare.radius, 1);
  ASSERT_EQ(m.wheels.size(), 2u);
  EXPECT_EQ(m.wheels[1].radius, 3);
  EXPECT_EQ(m.gears, std::vector<double>{4});
  EXPECT_EQ(m.drawer.at("a b").radius, 5);
  EXPECT_EQ(m.cargo.json, R"([1,{"x":"y"}])");
  ASSERT_EQ(m.notes.size(), 2u);
  EXPECT_EQ(m.notes.at("a.b").json, "null");
  EXPECT_EQ(m.notes.at("c").json, "-2.5");
}

TEST(ConfigReader, KeepsDefaultsOfAbsentKeys) {
  const Machine m = read("{}");
  EXPECT_EQ(m.crew, 3);
  EXPECT_EQ(m.gears, (std::vector<double>{1, 2}));
  EXPECT_FALSE(m.weight.has_value());
}

TEST(ConfigReader, RoundTrips) {
  const Machine m = read(R"({"engine": "wind", "sail": 0.1, "weight": 2, "wheels": [{"radius": 0.7}],
    "cargo": {"a": [true]}, "notes": {"b": "c"}})");
  const std::string text = write_json(json_of(m), JsonLayout::indented);
  EXPECT_EQ(write_json(json_of(read(text)), JsonLayout::indented), text);
}

TEST(ConfigReader, RefusesBadValuesOneRuleEach) {
  const auto fails = [](const std::string& text, const std::vector<std::string>& parts) {
    expect_error<ConfigError>([&] { read(text); }, parts);
  };
  fails("[]", {"machine.json:1: the top level must be an object ([])"});
  fails("{\n\"crw\": 1}", {"machine.json:2: /crw is not a known key", "Did you mean 'crew'?"});
  fails("{\"crew\": 0}", {"machine.json:1: /crew is out of range (0, allowed >= 1 and <= 9)"});
  fails("{\"crew\": 2.5}", {"/crew must be a whole number (2.5)"});
  fails("{\"crew\": 99999999999999999999}", {"/crew is out of range"});
  fails("{\"serial\": -1}", {"/serial is out of range (-1, allowed >= 0"});
  fails("{\"loud\": 1}", {"/loud must be true or false (1)"});
  fails("{\"owner\": 3}", {"/owner must be text (3)"});
  fails("{\"pressure\": 0}", {"/pressure is out of range (0, allowed > 0)"});
  fails("{\"pressure\": \"2\"}", {"/pressure must be a number (\"2\")"});
  fails("{\"place\": [1, 2]}", {"/place must be a list of 3 numbers ([1,2])"});
  fails("{\"place\": [1, 2,\n 11]}", {"machine.json:2: /place/2 is out of range (11, allowed >= -10 and <= 10)"});
  fails("{\"engine\": \"staem\"}", {"/engine is not one of its words (\"staem\", allowed: steam, wind)", "'steam'?"});
  fails("{\"sail\": 1}", {"/sail does not apply here (engine is 'steam'; the key is for: wind)", "change 'engine'"});
  fails("{\"engine\": \"wind\"}", {"the top level lacks the key 'sail'"});
  fails("{\"wheels\": [{}]}", {"/wheels/0 lacks the key 'radius'"});
  fails("{\"wheels\": {}}", {"/wheels must be a list ({})"});
  fails("{\"weight\": null}", {"/weight must be a number (null)"});
  fails("{\"drawer\": {\"a/b\": {\"radius\": -1}}}", {"/drawer/a~1b/radius is out of range (-1, allowed > 0)"});
}

TEST(ConfigReader, AppliesOverrides) {
  const Machine m = read("{\"wheels\": [{\"radius\": 1}, {\"radius\": 2}], \"drawer\": {\"x\": {\"radius\": 1}}}",
                         {"wheels.1.radius=9", "owner=Ada", "spare.radius=3", "place=[1,2,3]", "drawer.x.radius=8",
                          "drawer.y={\"radius\": 7}"});
  EXPECT_EQ(m.wheels[1].radius, 9);
  EXPECT_EQ(m.owner, "Ada");
  EXPECT_EQ(m.spare.radius, 3);
  EXPECT_EQ(m.place, (Vec3d{1, 2, 3}));
  EXPECT_EQ(m.drawer.at("x").radius, 8);
  EXPECT_EQ(m.drawer.at("y").radius, 7);
}

TEST(ConfigReader, OverridesOfItemsChangeTheDefaultOfAListThatIsNotGiven) {
  const Machine m = read("{}", {"place.1=3", "place.2=-1", "gears.1=5"});
  EXPECT_EQ(m.place, (Vec3d{0, 3, -1}));
  EXPECT_EQ(m.gears, (std::vector<double>{1, 5}));
  const auto fails = [&](const std::string& override_text, const std::vector<std::string>& parts) {
    expect_error<ConfigError>([&] { read("{}", {override_text}); }, parts);
  };
  fails("gears.2=5", {"override gears.2=5", "no list item '2' (the list has 2, counted from 0)"});
  fails("wheels.0.radius=1", {"no list item '0' (the list is empty). Give the whole list"});
  fails("place.1=11", {"machine.json (override place.1=11): /place/1 is out of range (11"});
  fails("weight.0=1", {"/weight is not given, so that nothing inside it can be set (it must be a number)",
                       "Set all of it: weight=VALUE"});
}

TEST(ConfigReader, MessagesShowTheBeginOfLongText) {
  const std::string much(1 << 20, 'k');
  const auto message_of = [](const std::string& text, const std::vector<std::string>& overrides) {
    try {
      read(text, overrides);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  for (const std::string& message :
       {message_of("{\"" + much + "\": 1}", {}), message_of("{\"a" + much + "\": 1, \"a" + much + "\": 2}", {}),
        message_of("{\"engine\": \"" + much + "\"}", {}), message_of("{}", {"crew=" + much}),
        message_of("{}", {"place." + much + "=1"}), message_of("{\"crew\": 2}", {"crew." + much + "=1"}),
        message_of("{\"owner\": \"" + much + "\"}", {"owner.a=1"})}) {
    EXPECT_NE(message.find("kkk..."), std::string::npos) << message.substr(0, 500);
    EXPECT_LT(message.size(), 800u);
  }
}

TEST(ConfigReader, RefusesBadOverrides) {
  const std::string text = "{\"wheels\": [{\"radius\": 1}], \"crew\": 2, \"drawer\": {\"left\": {\"radius\": 1}}}";
  const auto fails = [&](const std::string& override_text, const std::vector<std::string>& parts) {
    expect_error<ConfigError>([&] { read(text, {override_text}); }, parts);
  };
  fails("crew", {"machine.json (override crew)", "key.path=value"});
  fails("=3", {"key.path=value"});
  fails("crw=3", {"machine.json (override crw=3): /crw is not a known key", "Did you mean 'crew'?"});
  fails("spare.radus=3", {"/spare/radus is not a known key", "'radius'?"});
  fails("wheels.1.radius=3", {"override wheels.1.radius=3", "no list item '1' (the list has 1"});
  fails("wheels.first.radius=3", {"no list item 'first'"});
  fails("crew.size=3", {"there is no 'size' here (2 has no keys)"});
  fails("drawer.leftt.radius=3", {"/drawer/leftt does not exist (there are: left)", "Did you mean 'left'?"});
  fails("crew=0", {"machine.json (override crew=0): /crew is out of range (0"});
  fails("place=[1,2", {"override place=[1,2", "not valid JSON"});
}

TEST(ConfigReader, DefaultsReadBack) {
  const std::string text = commented_json(describe<Machine>(), json_of(Machine{}));
  EXPECT_NE(text.find("\"crew\": 3,  // People; >= 1 and <= 9"), std::string::npos) << text;
  EXPECT_NE(text.find("// \"sail\": 5.0,"), std::string::npos) << text;
  EXPECT_EQ(write_json(json_of(read(text)), JsonLayout::compact), write_json(json_of(Machine{}), JsonLayout::compact));
}

TEST(ConfigReader, SwappedLettersAreOneMistake) {
  EXPECT_EQ(did_you_mean("dnesity", {"density", "identity"}), " Did you mean 'density'?");
  EXPECT_EQ(did_you_mean("zzz", {"density"}), "");
}

}  // namespace
}  // namespace graupel::io

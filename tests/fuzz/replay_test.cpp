// Every input in corpus/TARGET and regressions/TARGET through its target: refused with a message or taken, quickly, and
// with no more memory than its size justifies.
#include <gtest/gtest.h>

#include <vector>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/harmless.h"

namespace graupel::fuzz {

namespace {

class FuzzInputs : public ::testing::TestWithParam<const Target*> {};
class FuzzMutators : public ::testing::TestWithParam<const Target*> {};

std::vector<const Target*> with_mutators() {
  std::vector<const Target*> targets;
  for (const Target* target : all_targets)
    if (target->mutate != nullptr) targets.push_back(target);
  return targets;
}

TEST_P(FuzzInputs, AreRefusedOrTaken) {
  const Target& target = *GetParam();
  int inputs = 0;
  for (const char* kind : {"corpus", "regressions"}) {
    const std::string folder = std::string(GRAUPEL_SOURCE_DIR "/tests/fuzz/") + kind + "/" + target.name;
    for (const std::string& name : names_in(folder)) {
      const std::string bytes = read_file(folder + "/" + name);
      EXPECT_LT(bytes.size(), 100000u) << name;
      expect_harmless(target, bytes, kind + ("/" + name));
      ++inputs;
    }
  }
  EXPECT_GT(inputs, 0) << "no corpus";
}

/// The mutators keep what a reader would refuse at once, so that a part of what they make is taken.
TEST_P(FuzzMutators, ReachBehindTheFirstChecks) {
  const Target& target = *GetParam();
  const std::string folder = std::string(GRAUPEL_SOURCE_DIR "/tests/fuzz/corpus/") + target.name;
  Random random(7);
  int taken = 0, refused = 0;
  for (const std::string& name : names_in(folder)) {
    const std::string bytes = read_file(folder + "/" + name);
    for (int k = 0; k < 20; ++k) {
      const std::string changed = target.mutate(bytes, bytes.size() + 1000, random);
      try {
        target.run(changed);
        ++taken;
      } catch (const Error&) {
        ++refused;
      }
    }
  }
  EXPECT_GT(taken, 0);
  EXPECT_GT(refused, 0);
}

std::string name_of(const ::testing::TestParamInfo<const Target*>& target) { return target.param->name; }

INSTANTIATE_TEST_SUITE_P(Targets, FuzzInputs, ::testing::ValuesIn(all_targets), name_of);
INSTANTIATE_TEST_SUITE_P(Targets, FuzzMutators, ::testing::ValuesIn(with_mutators()), name_of);

}  // namespace
}  // namespace graupel::fuzz

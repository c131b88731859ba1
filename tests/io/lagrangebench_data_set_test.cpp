// LagrangeBench data sets: what we write h5py reads and the other way round; damaged files are named.
#include "io/lagrangebench_data_set.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/io/expect_error.h"
#include "tests/io/python.h"
#include "tests/io/sample_series.h"

namespace graupel::io {
namespace {

using namespace std::string_literals;

void write_sample(const std::string& file, int64_t count, int dimensions) {
  write_lagrangebench_split(file, count,
                            [&](int64_t i) { return sample_series(20, 5, dimensions, static_cast<float>(i)); });
}

TEST(LagrangeBenchDataSet, ComesBackBitForBit) {
  const TemporaryFolder folder;
  for (const int dimensions : {2, 3}) {
    write_sample(folder.file("train.h5"), 3, dimensions);
    const auto split = open_lagrangebench_split(folder.file("train.h5"));
    ASSERT_EQ(split->count(), 3);
    for (int64_t i = 0; i < 3; ++i)
      EXPECT_TRUE(same_values(split->read(i), sample_series(20, 5, dimensions, static_cast<float>(i)))) << i;
    write_sample(folder.file("again.h5"), 3, dimensions);
    EXPECT_TRUE(bytes_of(folder.file("again.h5")) == bytes_of(folder.file("train.h5")));
  }
}

/// The steps of its H5Dataset (lagrangebench/data/data.py).
const char* loader = R"(
import sys, h5py, numpy as np
with h5py.File(sys.argv[1], "r") as f:
    keys = list(f.keys())
    assert keys == ["00000", "00001"], keys
    assert f["00000/position"].shape == (20, 5, int(sys.argv[2]))
    for i, key in enumerate(keys):
        x = f[key]["position"][3:9].transpose((1, 0, 2))
        p, t, a = np.meshgrid(np.arange(5), np.arange(3, 9), np.arange(int(sys.argv[2])), indexing="ij")
        assert x.dtype == np.float32
        assert np.array_equal(x, (i + t + p / 4 + a / 16).astype(np.float32))
        assert np.array_equal(f[key]["particle_type"][:], 5 + np.arange(5) % 2)
)";

TEST(LagrangeBenchDataSet, H5pyReadsIt) {
  const TemporaryFolder folder;
  if (!python_has(folder, "h5py")) GTEST_SKIP() << "python3-h5py is not installed";
  for (const int dimensions : {2, 3}) {
    write_sample(folder.file("train.h5"), 2, dimensions);
    const auto outcome = run_python(folder, loader, folder.file("train.h5") + " " + std::to_string(dimensions));
    EXPECT_TRUE(outcome.good) << outcome.output;
  }
}

/// As data_gen/lagrangebench_data/gen_dataset.py writes them, and damaged ones.
const char* maker = R"(
import sys, h5py, numpy as np
t, p, a = np.meshgrid(np.arange(20), np.arange(5), np.arange(2), indexing="ij")
x = t + p / 4 + a / 16
types = 5 + np.arange(5) % 2
def make(name, x=x, types=types, **more):
    with h5py.File(sys.argv[1] + "/" + name + ".h5", "w") as f:
        f.create_dataset("00000/particle_type", data=types)
        f.create_dataset("00000/position", data=x, dtype=more.pop("dtype", np.float32), **more)
make("gzip", compression="gzip")
make("plain")
make("wide", dtype=np.float64)
make("chunked", chunks=(3, 2, 2), compression="gzip", shuffle=True, fletcher32=True)
make("flat", x=x[:, :, 0])
make("one_axis", x=x[:, :, :1])
make("few_types", types=types[:3])
make("real_types", types=types.astype(float))
make("lzf", compression="lzf", chunks=(20, 5, 2))
with h5py.File(sys.argv[1] + "/no_types.h5", "w") as f:
    f.create_dataset("00000/position", data=x)
with h5py.File(sys.argv[1] + "/link.h5", "w") as f:
    f["00000"] = h5py.ExternalLink("gzip.h5", "00000")
)";

class LagrangeBenchFiles : public testing::Test {
 protected:
  void SetUp() override {
    if (!python_has(folder_, "h5py")) GTEST_SKIP() << "python3-h5py is not installed";
    const auto outcome = run_python(folder_, maker, folder_.path());
    ASSERT_TRUE(outcome.good) << outcome.output;
  }
  TemporaryFolder folder_;
};

TEST_F(LagrangeBenchFiles, OfH5pyAreRead) {
  for (const char* name : {"gzip", "plain", "wide", "chunked"}) {
    const auto split = open_lagrangebench_split(folder_.file(name + ".h5"s));
    ASSERT_EQ(split->count(), 1) << name;
    EXPECT_TRUE(same_values(split->read(0), sample_series(20, 5, 2))) << name;
  }
}

TEST_F(LagrangeBenchFiles, OfOtherContentsAreRefused) {
  const auto refused = [&](const std::string& name, const std::string& words) {
    expect_error<InputError>([&] { open_lagrangebench_split(folder_.file(name + ".h5"))->read(0); },
                             {name + ".h5", words});
  };
  refused("flat", "'position' does not have 3 dimensions");
  refused("one_axis", "'position' is not 2- or 3-dimensional");
  refused("few_types", "different numbers of particles");
  refused("real_types", "'particle_type' does not hold whole numbers");
  refused("no_types", "it lacks 'particle_type'");
  refused("lzf", "which is not read");
  refused("link", "links that lead elsewhere");
  refused("missing", "No such file");
}

TEST(LagrangeBenchDataSet, NeedsOneNumberOfFrames) {
  const TemporaryFolder folder;
  expect_error<InputError>(
      [&] { write_lagrangebench_split(folder.file("a.h5"), 2, [](int64_t i) { return sample_series(4 + i, 2, 3); }); },
      {"has 5 frames, those before it 4"});
}

}  // namespace
}  // namespace graupel::io

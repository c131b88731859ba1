// Data sets of geoelements/gns: what we write NumPy reads and the other way round; damaged archives are named.
#include "io/gns_data_set.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "io/npy_header.h"
#include "io/zip_archive.h"
#include "tests/io/expect_error.h"
#include "tests/io/python.h"
#include "tests/io/sample_series.h"

namespace graupel::io {
namespace {

using namespace std::string_literals;

void write_sample(const std::string& file, int64_t count, int dimensions) {
  write_gns_split(file, count, [&](int64_t i) {
    ParticleSeries series = sample_series(4 + i, 3, dimensions, static_cast<float>(i));
    if (dimensions == 2) series.material_property = {0.25f, 0.5f, 0.75f};
    return series;
  });
}

TEST(GnsDataSet, ComesBackBitForBit) {
  const TemporaryFolder folder;
  for (const int dimensions : {2, 3}) {
    const std::string file = folder.file("train.npz");
    write_sample(file, 12, dimensions);
    const auto split = open_gns_split(file);
    ASSERT_EQ(split->count(), 12);
    for (int64_t i = 0; i < 12; ++i) {  // 10 and 11 in the order of their numbers, not of their names
      ParticleSeries wanted = sample_series(4 + i, 3, dimensions, static_cast<float>(i));
      if (dimensions == 2) wanted.material_property = {0.25f, 0.5f, 0.75f};
      EXPECT_TRUE(same_values(split->read(i), wanted)) << i;
    }
    const std::string bytes = bytes_of(file);
    write_sample(file, 12, dimensions);
    EXPECT_TRUE(bytes_of(file) == bytes);
  }
}

/// The steps of its data loader (gns/data_loader.py).
const char* loader = R"(
import sys, numpy as np
with np.load(sys.argv[1], allow_pickle=True) as f:
    data = f["gns_data"] if "gns_data" in f else [item for _, item in f.items()]
parts = int(sys.argv[2])
assert len(data) == 2 and all(len(d) == parts for d in data)
for i, d in enumerate(data):
    x, types = d[0], np.full(d[0].shape[1], d[1], dtype=int)
    T, N, D = x.shape
    t, p, a = np.meshgrid(np.arange(T), np.arange(N), np.arange(D), indexing="ij")
    assert x.dtype == np.float32 and T == 4 + i
    assert np.array_equal(x, (i + t + p / 4 + a / 16).astype(np.float32))
    assert np.array_equal(types, 5 + np.arange(N) % 2)
    if parts == 3:
        assert np.array_equal(np.full(N, d[2], dtype=float), [0.25, 0.5, 0.75])
)";

TEST(GnsDataSet, NumPyReadsIt) {
  const TemporaryFolder folder;
  if (!python_has(folder, "numpy")) GTEST_SKIP() << "python3-numpy is not installed";
  for (const int dimensions : {2, 3}) {
    write_sample(folder.file("train.npz"), 2, dimensions);
    const auto outcome =
        run_python(folder, loader, folder.file("train.npz") + " " + std::to_string(dimensions == 2 ? 3 : 2));
    EXPECT_TRUE(outcome.good) << outcome.output;
  }
}

/// Every layout in the wild: of both kinds of archive, protocols 2 to 4, element types, orders.
const char* maker = R"(
import sys, io, pickle, zipfile, numpy as np
from numpy.lib import format as npy
def objects(*parts):
    out = np.empty(len(parts), dtype=object)
    for i, part in enumerate(parts): out[i] = part
    return out
def member(array, protocol):
    f = io.BytesIO()
    npy.write_array_header_1_0(f, {"descr": "|O", "fortran_order": False, "shape": array.shape})
    pickle.dump(array, f, protocol=protocol)
    return f.getvalue()
t, p, a = np.meshgrid(np.arange(4), np.arange(3), np.arange(2), indexing="ij")
x = (t + p / 4 + a / 16).astype(np.float32)
types = 5 + np.arange(3) % 2
to = sys.argv[1] + "/"
np.savez_compressed(to + "members.npz", simulation_trajectory_0=objects(x, types))
np.savez(to + "stored.npz", anything=objects(x, types))
np.savez(to + "tuples.npz", gns_data=objects((x, types)))
np.savez(to + "table.npz", gns_data=objects(x, types).reshape(1, 2))
np.savez(to + "wide.npz", a=objects(x.astype(np.float64), types.astype(np.int32)))
np.savez(to + "fortran.npz", a=objects(np.asfortranarray(x), types.astype(np.uint8)))
np.savez(to + "big_endian.npz", a=objects(x.astype(">f4"), types.astype(">i2")))
np.savez(to + "zero_dim.npz", a=np.array(None, dtype=object))
z = np.empty((), dtype=object); z[()] = (x, types)
np.savez(to + "zero_dim.npz", a=z)
np.savez(to + "lists.npz", gns_data=objects([x, types]))
for protocol in (2, 3, 4):
    with zipfile.ZipFile(to + f"protocol{protocol}.npz", "w") as f:
        f.writestr("a.npy", member(objects(x, types), protocol))
np.savez(to + "number.npz", gns_data=objects((x, 5)))
np.savez(to + "numpy_number.npz", gns_data=objects((x, np.int64(5))))
np.savez(to + "property.npz", gns_data=objects((x, 5, 0.5)))
np.savez(to + "numpy_property.npz", gns_data=objects((x, 5, np.float64(0.5))))
np.savez(to + "column.npz", gns_data=objects((x, 5, np.full((3, 1), 0.5))))
np.savez(to + "plain.npz", a=x)
np.savez(to + "wrong_shape.npz", a=objects(x[0], types))
np.savez(to + "wrong_types.npz", a=objects(x, types[:2]))
np.savez(to + "real_types.npz", a=objects(x, types.astype(float)))
np.savez(to + "half.npz", a=objects(x.astype(np.float16), types))
np.savez(to + "texts.npz", a=objects("x", "y"))
np.savez(to + "alone.npz", a=objects(x))
)";

class GnsFiles : public testing::Test {
 protected:
  void SetUp() override {
    if (!python_has(folder_, "numpy")) GTEST_SKIP() << "python3-numpy is not installed";
    const auto outcome = run_python(folder_, maker, folder_.path());
    ASSERT_TRUE(outcome.good) << outcome.output;
  }
  TemporaryFolder folder_;
};

TEST_F(GnsFiles, OfEveryLayoutAreRead) {
  for (const char* name : {"members", "stored", "tuples", "table", "wide", "fortran", "big_endian", "zero_dim", "lists",
                           "protocol2", "protocol3", "protocol4"}) {
    const auto split = open_gns_split(folder_.file(name + ".npz"s));
    ASSERT_EQ(split->count(), 1) << name;
    EXPECT_TRUE(same_values(split->read(0), sample_series(4, 3, 2))) << name;
  }
}

TEST_F(GnsFiles, WithOneNumberForAllParticlesAreRead) {
  ParticleSeries wanted = sample_series(4, 3, 2);
  wanted.particle_type = {5, 5, 5};
  for (const char* name : {"number", "numpy_number"})
    EXPECT_TRUE(same_values(open_gns_split(folder_.file(name + ".npz"s))->read(0), wanted)) << name;
  wanted.material_property = {0.5f, 0.5f, 0.5f};
  for (const char* name : {"property", "numpy_property", "column"})
    EXPECT_TRUE(same_values(open_gns_split(folder_.file(name + ".npz"s))->read(0), wanted)) << name;
}

TEST_F(GnsFiles, OfOtherContentsAreRefused) {
  const auto refused = [&](const std::string& name, const std::string& words) {
    expect_error<InputError>([&] { open_gns_split(folder_.file(name + ".npz"))->read(0); },
                             {name + ".npz", "a.npy", words});
  };
  refused("plain", "it holds numbers of type '<f4'");
  refused("wrong_shape", "its positions have the shape (3, 2)");
  refused("wrong_types", "its particle types have the shape (2,), not (3,)");
  refused("real_types", "elements of type 'f8' where whole numbers are needed");
  refused("half", "elements of type 'f2'");
  refused("texts", "its positions are no array of numbers");
  refused("alone", "a trajectory has 1 parts");
}

TEST(GnsDataSet, PicklesThatCallSomethingAreRefused) {
  const TemporaryFolder folder;
  const std::string evil =
      "\x80\x02"
      "cos\nsystem\n(X\x04\0\0\0truetR."s;
  write_zip(folder.file("a.npz"), {"x.npy"}, [&](std::size_t) { return npy_object_header(2) + evil; });
  expect_error<InputError>([&] { open_gns_split(folder.file("a.npz"))->read(0); },
                           {"a.npz'", "'x.npy'", "'os.system', which is refused"});
  write_zip(folder.file("b.npz"), {"gns_data.npy"}, [&](std::size_t) { return npy_object_header(2) + evil; });
  expect_error<InputError>([&] { open_gns_split(folder.file("b.npz")); }, {"'gns_data.npy'", "'os.system'"});
}

TEST(GnsDataSet, EveryCutOfTheArchiveIsRefused) {
  const TemporaryFolder folder;
  write_sample(folder.file("a.npz"), 2, 3);
  const std::string bytes = bytes_of(folder.file("a.npz"));
  for (std::size_t length = 0; length < bytes.size(); length += 7) {
    const std::string file = folder.write("cut.npz", bytes.substr(0, length));
    EXPECT_THROW(open_gns_split(file), InputError) << length;
  }
}

TEST(GnsDataSet, ChangedBytesOfTheArchiveAreReadOrRefused) {
  const TemporaryFolder folder;
  write_sample(folder.file("a.npz"), 1, 3);
  const std::string bytes = bytes_of(folder.file("a.npz"));
  int refused = 0;
  for (std::size_t place = 0; place < bytes.size(); place += 3) {
    std::string changed = bytes;
    changed[place] = static_cast<char>(changed[place] ^ 0x55);
    try {
      open_gns_split(folder.write("changed.npz", changed))->read(0);
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, static_cast<int>(bytes.size() / 6));
}

TEST(ZipArchive, NamesWhatIsWrong) {
  const TemporaryFolder folder;
  expect_error<InputError>([&] { ZipReader(folder.file("no.npz")); }, {"no.npz", "No such file"});
  expect_error<InputError>([&] { ZipReader(folder.write("text.npz", "not an archive")); }, {"text.npz"});
  write_zip(folder.file("a.npz"), {"x"}, [](std::size_t) { return std::string(1000, 'x'); });
  EXPECT_EQ(ZipReader(folder.file("a.npz")).read(0), std::string(1000, 'x'));
  std::string bytes = bytes_of(folder.file("a.npz"));
  const std::size_t central = bytes.find("PK\x01\x02");
  bytes.replace(central + 24, 4, "\xff\xff\xff\x7f");  // its size: 2 GiB of a few bytes
  expect_error<InputError>([&] { ZipReader(folder.write("huge.npz", bytes)).read(0); },
                           {"huge.npz", "'x'", "more bytes than it can unfold to"});
  expect_error<IoError>([&] { write_zip(folder.file("no/a.npz"), {"x"}, [](std::size_t) { return "x"; }); },
                        {"no/a.npz", "No such file"});
}

TEST(ZipArchive, PassesOnWhatAMemberThrows) {
  const TemporaryFolder folder;
  expect_error<InputError>(
      [&] {
        write_zip(folder.file("a.npz"), {"x", "y"}, [](std::size_t i) -> std::string {
          if (i == 1) throw InputError("the second is bad");
          return "x";
        });
      },
      {"the second is bad"});
}

}  // namespace
}  // namespace graupel::io

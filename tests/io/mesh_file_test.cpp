#include "io/mesh/mesh_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "core/system/error.h"
#include "expect_error.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

const std::vector<Vec3d> corners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
const std::vector<std::array<int32_t, 3>> faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

template <typename T>
void put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string obj_text() {
  std::string text = "mtllib none.mtl\no tet\n";
  for (const auto& c : corners)
    text += "v " + std::to_string(c[0]) + " " + std::to_string(c[1]) + " " + std::to_string(c[2]) + "\n";
  for (const auto& f : faces)
    text += "f " + std::to_string(f[0] + 1) + " " + std::to_string(f[1] + 1) + " " + std::to_string(f[2] + 1) + "\n";
  return text;
}

std::string ply_header(const std::string& format, const std::string& vertex, std::size_t faces_count) {
  return "ply\nformat " + format + " 1.0\ncomment made by hand\nelement vertex 4\n" + vertex + "element face " +
         std::to_string(faces_count) + "\nproperty list uchar int vertex_indices\nend_header\n";
}

std::string ply_text() {
  std::string text = ply_header("ascii", "property float x\nproperty float y\nproperty float z\n", 4);
  for (const auto& c : corners)
    text += std::to_string(c[0]) + " " + std::to_string(c[1]) + " " + std::to_string(c[2]) + "\n";
  for (const auto& f : faces)
    text += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
  return text;
}

std::string ply_bytes() {
  std::string bytes = ply_header("binary_little_endian",
                                 "property double x\nproperty uchar red\nproperty double y\nproperty double z\n", 4);
  for (const auto& c : corners) {
    put(bytes, c[0]);
    put(bytes, uint8_t(200));
    put(bytes, c[1]);
    put(bytes, c[2]);
  }
  for (const auto& f : faces) {
    put(bytes, uint8_t(3));
    for (const int32_t v : f) put(bytes, v);
  }
  return bytes;
}

std::string stl_text() {
  std::string text = "solid tet\n";
  for (const auto& f : faces) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const int32_t v : f)
      text += "vertex " + std::to_string(corners[v][0]) + " " + std::to_string(corners[v][1]) + " " +
              std::to_string(corners[v][2]) + "\n";
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid tet\n";
}

std::string stl_bytes() {
  std::string bytes = "solid, yet binary";
  bytes.resize(80, ' ');
  put(bytes, uint32_t(4));
  for (const auto& f : faces) {
    for (int i = 0; i < 3; ++i) put(bytes, 0.0f);
    for (const int32_t v : f)
      for (int axis = 0; axis < 3; ++axis) put(bytes, static_cast<float>(corners[v][axis]));
    put(bytes, uint16_t(0));
  }
  return bytes;
}

double volume(const TriangleMesh& mesh) {
  double six = 0;
  for (const auto& t : mesh.triangles) six += dot(mesh.vertices[t[0]], cross(mesh.vertices[t[1]], mesh.vertices[t[2]]));
  return six / 6;
}

struct Sample {
  std::string name, bytes;
};

std::vector<Sample> samples() {
  return {{"a.obj", obj_text()},
          {"a.ply", ply_text()},
          {"b.ply", ply_bytes()},
          {"a.STL", stl_text()},
          {"b.stl", stl_bytes()}};
}

TEST(MeshFile, ReadsEveryFormatToTheSameSolid) {
  TemporaryFolder folder;
  for (const auto& sample : samples()) {
    const TriangleMesh mesh = read_mesh(folder.write(sample.name, sample.bytes), 2);
    EXPECT_EQ(mesh.vertices.size(), 4u) << sample.name;  // STL: corners became shared vertices
    EXPECT_EQ(mesh.triangles.size(), 4u) << sample.name;
    EXPECT_NEAR(volume(mesh), 8.0 / 6, 1e-12) << sample.name;  // outward triangles: positive
  }
}

TEST(MeshFile, TakesUtf8sByteOrderMarkAndNamesOtherEncodings) {
  TemporaryFolder folder;
  for (const auto& sample : samples()) {
    if (sample.name == "b.stl") continue;
    EXPECT_EQ(read_mesh(folder.write(sample.name, "\xef\xbb\xbf" + sample.bytes)).triangles.size(), 4u) << sample.name;
    expect_error<InputError>([&] { read_mesh(folder.write(sample.name, "\xff\xfe" + sample.bytes)); },
                             {sample.name, "text in UTF-16 by its byte order mark"});
  }
  EXPECT_EQ(read_points(folder.write("a.xyz",
                                     "\xef\xbb\xbf"
                                     "1 2 3\n"))
                .front(),
            (Vec3d{1, 2, 3}));
  expect_error<InputError>(
      [&] {
        read_points(folder.write("a.txt",
                                 "\xfe\xff"
                                 "1 2 3\n"));
      },
      {"a.txt", "UTF-16"});
  std::string marked = stl_bytes();  // of a binary file these are the first bytes of its title
  marked.replace(0, 3, "\xff\xfe ");
  EXPECT_EQ(read_mesh(folder.write("b.stl", marked)).triangles.size(), 4u);
}

TEST(MeshFile, TakesIndentedLinesAndEveryKindOfCorner) {
  TemporaryFolder folder;
  const std::string head = "  v 0 0 0 1.0\n\tv 1 0 0 1.0\nv 0 1 0 1.0\nvt 0 0\nvn 0 0 1\n";
  for (const std::string face : {"1 2 3", "1/1 2/1 3/1", "1//1 2//1 3//1", "1/1/1 2/1/1 3/1/1", "-3 -2 -1"}) {
    const TriangleMesh mesh = read_mesh(folder.write("corners.obj", head + " f " + face + " \n"));
    ASSERT_EQ(mesh.triangles.size(), 1u) << face;
    EXPECT_EQ(mesh.triangles[0], (std::array<int32_t, 3>{0, 1, 2})) << face;
  }
}

TEST(MeshFile, SplitsPolygons) {
  TemporaryFolder folder;
  const std::string square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
  const std::string ply = ply_header("ascii", "property float x\nproperty float y\nproperty float z\n", 1) + square;
  EXPECT_EQ(read_mesh(folder.write("q.ply", ply)).triangles.size(), 2u);
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n";
  EXPECT_EQ(read_mesh(folder.write("q.obj", obj)).triangles.size(), 2u);
}

TEST(MeshFile, EveryTruncationIsAnErrorOrASmallerMesh) {
  TemporaryFolder folder;
  for (const auto& sample : samples())
    for (std::size_t n = 0; n < sample.bytes.size(); n += 3) {
      const std::string path = folder.write("cut" + sample.name, sample.bytes.substr(0, n));
      try {
        const TriangleMesh mesh = read_mesh(path);
        // Only text without an end mark can be shorter and still valid.
        EXPECT_TRUE(sample.name == "a.obj" || sample.name == "a.ply" || sample.name == "a.STL")
            << sample.name << " " << n;
        EXPECT_LE(mesh.triangles.size(), 4u);
      } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find(path), std::string::npos);
      }
    }
}

TEST(MeshFile, RandomDamageIsAnErrorOrAMesh) {
  TemporaryFolder folder;
  uint32_t state = 1;
  const auto next = [&] { return state = state * 1664525u + 1013904223u, state >> 8; };
  for (const auto& sample : samples())
    for (int trial = 0; trial < 300; ++trial) {
      std::string bytes = sample.bytes;
      for (int k = 0; k < 3; ++k) bytes[next() % bytes.size()] = static_cast<char>(next());
      try {
        const TriangleMesh mesh = read_mesh(folder.write("d" + sample.name, bytes));
        for (const auto& t : mesh.triangles)
          for (const int32_t v : t) ASSERT_LT(static_cast<std::size_t>(v), mesh.vertices.size());
      } catch (const InputError&) {
      }
    }
}

TEST(MeshFile, NamesTheFault) {
  TemporaryFolder folder;
  const auto fails = [&](const std::string& name, const std::string& bytes, const std::string& part) {
    const std::string path = folder.write(name, bytes);
    expect_error<InputError>([&] { read_mesh(path); }, {path, part});
  };
  fails("a.fbx", "x", "unknown kind of mesh (ending '.fbx', known: .obj .ply .stl)");
  fails("a.obj", "v 0 0 0\n", "no triangles");
  fails("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "does not exist");
  fails("c.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not three finite numbers (line 1: 'v 0 0 nan')");
  const std::string points = "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\n";
  fails("d.obj", points + "  v -0.1 oops -0.1\r\nf 1 2 3\r\n", "(line 4: '  v -0.1 oops -0.1')");
  fails("e.obj", "v 0 0 0.5x\n" + points + "f 1 2 3\n", "(line 1: 'v 0 0 0.5x')");
  for (const std::string face : {"1.5 2 3", "1 2 4abc", "2x 1 3", "1/1/ 2 3", "1/x 2 3", "1 2 3 \\"})
    fails("f.obj", points + "f " + face + "\n", "is no index (line 4: 'f " + face + "')");
  std::string many_corners;
  for (int i = 0; i < 1700; ++i) many_corners += " 1 2 3";
  fails("h.obj", points + "f" + many_corners + "\n", "has 5100 corners, at most 5000 are cut into triangles (line 4");
  fails("i.obj", points + std::string("f 1\0 2 3\n", 10), "NUL byte");
  fails("g.obj", points + "\tf 1 2\r\n", "fewer than three corners (line 4: ' f 1 2')");
  fails("a.ply", "plx\n", "not a PLY file");
  fails("b.ply", "ply\nformat binary_big_endian 1.0\nend_header\n", "binary_big_endian");
  fails("c.ply", ply_header("ascii", "property float x\nproperty float y\n", 0), "lack x, y or z");
  fails("d.ply", ply_header("ascii", "property half x\n", 0), "unknown PLY type 'half'");
  fails("e.ply",
        "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float "
        "z\nend_header\n",
        "ends early");
  std::string nan = stl_bytes();
  const float bad = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(nan.data() + 84 + 12, &bad, sizeof bad);
  fails("n.stl", nan, "not finite");
  fails("s.stl", "S" + stl_bytes().substr(1, 100), "neither an ASCII nor a complete binary STL");
  expect_error<InputError>([&] { read_mesh(folder.file("none.obj")); }, {"none.obj", "No such file"});
}

TEST(Points, ReadsTextAndPly) {
  TemporaryFolder folder;
  const auto text = read_points(folder.write("p.txt", "# x y z\n1 2 3\r\n\n  +4,5\t6  # last\n7 8 9 255 0 0"), 10);
  ASSERT_EQ(text.size(), 3u);
  EXPECT_EQ(text[1], (Vec3d{40, 50, 60}));
  EXPECT_EQ(text[2], (Vec3d{70, 80, 90}));
  EXPECT_EQ(read_points(folder.write("p.ply", ply_bytes())).size(), 4u);
}

TEST(Points, NamesTheLineOfTheFault) {
  TemporaryFolder folder;
  const auto fails = [&](const std::string& name, const std::string& bytes, const std::string& part) {
    const std::string path = folder.write(name, bytes);
    expect_error<InputError>([&] { read_points(path); }, {path, part});
  };
  fails("a.xyz", "1 2 3\n1 2\n", "a.xyz:2': not a point");
  fails("b.xyz", "1 2 x\n", "b.xyz:1': not a point");
  fails("c.xyz", "1 2 3x\n", "c.xyz:1': not a point");
  fails("d.xyz", "1 2 inf\n", "not finite");
  fails("e.xyz", "# nothing\n", "no points");
  fails("f.csv", "1 2 3\n", "unknown kind of point list");
}

}  // namespace
}  // namespace graupel::io

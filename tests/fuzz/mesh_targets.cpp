// Mesh files: read and checked as bodies are.
#include "io/mesh/mesh_file.h"
#include "sparsegrid/mesh/mesh_topology.h"
#include "tests/fuzz/fuzz_target.h"

namespace graupel::fuzz {

namespace {

void read(const std::string& bytes, const std::string& ending) {
  const TriangleMesh mesh = io::read_mesh(file_with(bytes, "input" + ending), 0.5);
  static_cast<void>(sparsegrid::faults_of(mesh));
}

void run_obj(const std::string& bytes) { read(bytes, ".obj"); }
void run_stl(const std::string& bytes) { read(bytes, ".stl"); }
void run_ply(const std::string& bytes) {
  try {
    read(bytes, ".ply");
  } catch (const std::exception&) {
    static_cast<void>(io::read_points(file_with(bytes, "input.ply")));  // without faces
    throw;
  }
}

}  // namespace

const Target targets::mesh_obj = {"mesh_obj", run_obj, nullptr};
const Target targets::mesh_ply = {"mesh_ply", run_ply, nullptr};
const Target targets::mesh_stl = {"mesh_stl", run_stl, nullptr};

}  // namespace graupel::fuzz

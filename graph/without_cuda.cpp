// Stands in for the kernels of cuda/ in a build without CUDA.
#include "core/system/error.h"
#include "graph/corrections/density_solver.h"
#include "graph/corrections/free_flight_launch.h"
#include "graph/cuda_batch.h"
#include "graph/cuda_simulator.h"
#include "graph/topology/grid_launch.h"

namespace graupel::graph {

namespace {
[[noreturn]] void no_cuda() {
  throw ConfigError("device 'cuda' is not usable (this program was built without CUDA). Use device 'cpu'");
}
}  // namespace

bool solves_density_at_once(int64_t, int64_t) { return false; }
void solve_density(const std::vector<DensitySystem>&, void*) { no_cuda(); }

void flight::start_on_gpu(const Groups&, const std::vector<float>&, float*, void*) { no_cuda(); }
void flight::find_groups_on_gpu(const std::vector<Groups>&, void*) { no_cuda(); }
void flight::correct_on_gpu(const std::vector<Correction>&, void*) { no_cuda(); }

bool builds_grid_at_once(int, int64_t) { return false; }
void build_grid(const GridProgram&, void*) { no_cuda(); }

struct CudaSimulator::Impl {};
CudaSimulator::CudaSimulator(const nn::Weights&) { no_cuda(); }
CudaSimulator::~CudaSimulator() = default;
void CudaSimulator::start(const CudaScene&) { no_cuda(); }
bool CudaSimulator::advance() { no_cuda(); }
std::vector<Vec3f> CudaSimulator::accelerations() { no_cuda(); }
void CudaSimulator::evaluate(const std::vector<float>&, const std::vector<int32_t>&, const std::vector<Vec3f>&,
                             const Vec3d&, std::vector<float>&) {
  no_cuda();
}
std::vector<Vec3f> CudaSimulator::positions() const { no_cuda(); }
CudaFrameTime CudaSimulator::frame_time() const { no_cuda(); }

struct CudaBatch::Impl {};
CudaBatch::CudaBatch(const nn::Weights&) { no_cuda(); }
CudaBatch::~CudaBatch() = default;
void CudaBatch::start(const std::vector<CudaScene>&, int64_t) { no_cuda(); }
void CudaBatch::run(const std::function<void(int64_t)>&) { no_cuda(); }
double CudaBatch::seconds() const { no_cuda(); }
void CudaBatch::keep_frames() { no_cuda(); }
int64_t CudaBatch::kept_frames(std::size_t) const { no_cuda(); }
void CudaBatch::read_frames(const std::function<void(const std::vector<FramePiece>&)>&, int64_t) { no_cuda(); }

}  // namespace graupel::graph

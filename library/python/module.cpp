// The extension module graupel._graupel. The package's Python files (graupel/) make its public face.
#include <nanobind/stl/string.h>

#include "core/parallel/device.h"
#include "core/parallel/instruction_set.h"
#include "library/python/binding.h"

NB_MODULE(_graupel, module) {
  using namespace graupel;
  module.doc() = "Graupel's solver and models over NumPy arrays; import graupel instead.";
  nanobind::set_leak_warnings(false);  // processes that end at once, as workers of torch's loaders, keep their objects
  python::register_errors();
  python::watch_end_of_interpreter(module);
  module.attr("__version__") = GRAUPEL_VERSION;
  module.attr("_native") = bool(GRAUPEL_NATIVE);
  module.def("cuda_available", &cuda_available, "Whether the package was built with CUDA and there is a usable GPU.");
  module.def(
      "instruction_set", [] { return std::string(name_of(instruction_set())); },
      "Instructions that the solver's loops use here: 'avx512', 'avx2' or 'baseline' (SSE2, slower).\n\n"
      "The environment variable GRAUPEL_SIMD chooses less than the best. Raises ConfigError for an unknown one.");
  module.def(
      "set_num_threads",
      [](int64_t threads) {
        if (threads < 0 || threads > 4096)
          throw ConfigError("threads is not possible (" + std::to_string(threads) +
                            ", allowed: 0 to 4096; 0: all that the process may use). Correct it");
        set_num_threads(static_cast<int>(threads));
      },
      nanobind::arg("threads"), "Number of CPU threads of all runs, up to 4096; 0: all that the process may use.");
  module.def("num_threads", &num_threads, "Number of CPU threads of all runs.");
  python::bind_scene(module);
  python::bind_gpu_array(module);
  python::bind_simulation(module);
  python::bind_batch(module);
  python::bind_trajectory(module);
  python::bind_models(module);
}

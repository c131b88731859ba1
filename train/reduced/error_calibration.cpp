#include "train/reduced/error_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/simulation.h"
#include "rom/reduced_solver.h"

namespace graupel::train {

namespace {

std::vector<rom::ErrorIndicator> roll_out(const rom::ReducedModel& model, const io::TrajectoryReader& reader, int run,
                                          const std::string& file, CalibrationReport& report) {
  const Trajectory header = reader.header(run);
  std::vector<double> parameters;
  for (const io::NamedValue& p : reader.parameters(run)) parameters.push_back(p.value);
  mpm::PreparedScene prepared(io::parse_stored_scene(header.scene_json, file, file),
                              {.device = Device::cpu, .seed = header.seed});
  rom::ReducedSolver<float> solver(model, std::move(prepared), std::move(parameters), {});
  const std::vector<Vec3f> reference = reader.frames(run, 0, 1).front().position;
  std::vector<rom::ErrorIndicator> frames;
  double error2 = 0, displacement2 = 0;
  try {
    for (int64_t f = 1; f < static_cast<int64_t>(header.frame_count()); ++f) {
      solver.advance_frame();
      frames.push_back(solver.trust());
      const std::vector<Vec3f> truth = reader.frames(run, f, 1).front().position, position = solver.frame().position;
      for (std::size_t p = 0; p < truth.size(); ++p) {
        error2 += norm2(position[p].cast<double>() - truth[p].cast<double>());
        displacement2 += norm2(truth[p].cast<double>() - reference[p].cast<double>());
      }
    }
    report.errors.push_back(displacement2 > 0 ? std::sqrt(error2 / displacement2) : 0);
  } catch (const DivergedError&) {
    ++report.diverged;
  }
  ++report.runs;
  return frames;
}

/// Of a run from its latents in the training, over the displacement.
double reconstruction_error(const rom::ReducedModel& model, const io::TrajectoryReader& reader, int run) {
  rom::BoundPoints points(model);
  const auto r = static_cast<Eigen::Index>(model.latents());
  const auto start = std::lower_bound(model.training_run.begin(), model.training_run.end(), run);
  const auto first = static_cast<Eigen::Index>(start - model.training_run.begin());
  double error2 = 0, displacement2 = 0;
  for (int64_t f = 1; f < static_cast<int64_t>(reader.header(run).frame_count()); ++f) {
    const std::vector<Vec3f> truth = reader.frames(run, f, 1).front().position;
    const Eigen::Map<const Eigen::VectorXf> latent(model.training_latents.data() + (first + f) * r, r);
    const Eigen::VectorXf x = points.positions(latent.cast<double>());
    for (std::size_t i = 0; i < points.particles().size(); ++i) {
      const auto at = static_cast<Eigen::Index>(3 * i);
      const Vec3f& p = truth[static_cast<std::size_t>(points.particles()[i])];
      const Eigen::Vector3f true_x(p[0], p[1], p[2]);
      error2 += (x.segment<3>(at) - true_x).cast<double>().squaredNorm();
      displacement2 += (true_x - points.reference().segment<3>(at)).cast<double>().squaredNorm();
    }
  }
  return displacement2 > 0 ? std::sqrt(error2 / displacement2) : 0;
}

void roll_out_runs(rom::ReducedModel& model, const CalibrationOptions& options, CalibrationReport& report) {
  const Stopwatch watch;
  const io::TrajectoryReader reader(options.file);
  const int count = std::min(options.runs, reader.count());
  std::vector<std::vector<rom::ErrorIndicator>> runs;
  if (const auto curvature = rom::interpolation_curvature(model)) model.interpolation = {0, *curvature};
  for (int i = 0; i < count; ++i) {
    const int run = count > 1 ? i * (reader.count() - 1) / (count - 1) : reader.count() / 2;  // the outermost too
    runs.push_back(roll_out(model, reader, run, options.file, report));
    if (model.interpolation)
      model.interpolation->reconstruction =
          std::max(model.interpolation->reconstruction, reconstruction_error(model, reader, run));
  }
  model.usual = rom::usual_levels(runs);
  model.usual_error = report.errors.empty() ? 0 : *std::max_element(report.errors.begin(), report.errors.end());
  if (report.diverged > 0) {
    model.usual_error = std::max(model.usual_error, 1.0);
    model.interpolation.reset();  // its bound is of the fit, not of what a roll-out makes of it
  }
  report.seconds = watch.seconds();
}

}  // namespace

void calibrate_trust(rom::ReducedModel& model, const CalibrationOptions& options, CalibrationReport& report) {
  if (options.runs == 0) return;
  const auto say = [&](const std::string& text) {
    if (options.message) options.message(text);
  };
  try {
    roll_out_runs(model, options, report);
  } catch (const InputError& error) {
    say(fmt::format("no verdict on trust: the training runs cannot be rolled out ({})", error.what()));
    return;
  }
  say(fmt::format("trust: {} training runs rolled out in {:.1f} s, error up to {:.3g} % of the displacement",
                  report.runs, report.seconds, 100 * model.usual_error));
  if (report.diverged > 0)
    say(fmt::format(
        "WARNING: {} of them diverged, which counts as an error of 100 %: no run of this model is to be trusted. Take "
        "more samples, or other settings (--print-defaults)",
        report.diverged));
}

}  // namespace graupel::train

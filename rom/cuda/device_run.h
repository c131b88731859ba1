// Runs of one reduced-order model on a device, many instances at once: their arrays there, and the order of the
// kernels. `Backend` launches them: CUDA (rom/cuda/cuda_run.cu) or, in tests, fibers on a CPU (tests/rom/fiber_run.h).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <list>
#include <memory>
#include <utility>
#include <vector>

#include "core/parallel/buffer.h"
#include "core/system/error.h"
#include "mpm/materials/material_parameters.h"
#include "rom/cuda/device_branch.h"
#include "rom/cuda/device_decode.h"
#include "rom/cuda/device_elastic.h"
#include "rom/cuda/device_fit.h"
#include "rom/cuda/device_gather.h"
#include "rom/cuda/device_projection.h"
#include "rom/cuda/device_tables.h"

namespace graupel::rom::device {

struct RunSettings {
  int64_t steps_per_frame = 1;
  double dt = 0;              ///< [s]
  double pull = 0;            ///< as RunView has it
  double curve_step = 0;      ///< as RunView has it
  double contact_weight = 1;  ///< as RunView has it
};

/// A kernel of the step alone.
struct KernelTime {
  const char* name;
  double seconds;
};

class DeviceRun {
 public:
  virtual ~DeviceRun() = default;
  /// A frame of every instance that still runs.
  virtual void advance_frame() = 0;
  /// `steps` more steps within a frame, without a word to the host; seconds on the device.
  virtual double timed_steps(int64_t steps) = 0;
  /// What each kernel takes on the device, in the order of the step, as a mean over so many. The run is of no use
  /// afterwards.
  virtual std::vector<KernelTime> kernel_times(int times) = 0;
  virtual const InstanceState& state(int instance) const = 0;
  /// Positions [m] and velocities [m/s] of all particles, [particles, 6].
  virtual std::vector<float> frame(int instance) const = 0;
  virtual int64_t bytes() const = 0;  ///< on the device
};

/// The arrays of a coefficient map on a device.
class MapStore {
 public:
  MapStore(Device device, const MapTable& table)
      : inputs_(table.inputs),
        outputs_(table.outputs),
        count_(table.count),
        shift_(device, 0),
        scale_(device, 0),
        low_(device, 0),
        high_(device, 0),
        centers_(device, 0),
        weights_(device, 0),
        linear_(device, 0) {
    shift_.upload(table.shift);
    scale_.upload(table.scale);
    low_.upload(table.low);
    high_.upload(table.high);
    centers_.upload(table.centers);
    weights_.upload(table.weights);
    linear_.upload(table.linear);
  }
  MapView view() const {
    return {inputs_,     outputs_,     count_,          shift_.data(),   scale_.data(),
            low_.data(), high_.data(), centers_.data(), weights_.data(), linear_.data()};
  }
  int64_t bytes() const {
    return static_cast<int64_t>((centers_.size() + weights_.size() + linear_.size()) * sizeof(double));
  }

 private:
  int inputs_, outputs_, count_;
  Buffer<double> shift_, scale_, low_, high_, centers_, weights_, linear_;
};

/// The arrays of a model on a device.
class ModelStore {
 public:
  ModelStore(Device device, const ModelTable& table)
      : device_(device),
        closure_(device, table.closure),
        stress_map_(device, table.stress_map),
        affine_map_(device, table.affine_map),
        rate_(table.affine_is_rate) {
    view_.latents = table.latents;
    view_.particles = table.particles();
    view_.points = table.points();
    view_.samples = static_cast<int>(table.samples.size());
    view_.deformation_modes = table.deformation_modes;
    view_.stress_modes = table.stress_modes;
    view_.affine_modes = table.affine_modes;
    view_.deformation_stride =
        (table.deformation_modes + deformation_group - 1) / deformation_group * deformation_group;
    view_.stress_stride = static_cast<int>(table.stress_scale.size());
    view_.affine_stride = static_cast<int>(table.affine_scale.size());
    view_.deformation = keep(floats_, table.deformation);
    view_.deformation_mean = keep(floats_, table.deformation_mean);
    view_.stress_scale = keep(floats_, table.stress_scale);
    view_.affine_scale = keep(floats_, table.affine_scale);
    view_.field_mean = keep(floats_, table.field_mean);
    view_.sample_modes = keep(floats_, table.sample_modes);
    view_.stress = keep(pairs_, table.stress);
    view_.affine = keep(pairs_, table.affine);
    view_.point_particle = keep(indices_, table.point_particle);
    view_.sample_mean = keep(doubles_, table.sample_mean);
    view_.gram = keep(doubles_, table.gram);
    view_.sample_rows = 3 * view_.samples;
    view_.closure = closure_.view();
    view_.stress_map = stress_map_.view();
    view_.affine_map = affine_map_.view();
    view_.affine_is_rate = rate_;
    view_.deformation_alone = table.deformation_alone();
    view_.point_modes = keep(floats_, table.point_modes);
    view_.point_reference = keep(floats_, table.point_reference);
    view_.inverse = keep(doubles_, table.inverse);
    view_.condition = table.condition;
  }
  const ModelView& view() const { return view_; }
  int64_t bytes() const { return bytes_ + closure_.bytes() + stress_map_.bytes() + affine_map_.bytes(); }

 private:
  template <typename T>
  const T* keep(std::list<Buffer<T>>& all, const std::vector<T>& values) {
    all.emplace_back(device_, 0);
    all.back().upload(values);
    bytes_ += static_cast<int64_t>(values.size() * sizeof(T));
    return all.back().data();
  }

  Device device_;
  ModelView view_{};
  MapStore closure_, stress_map_, affine_map_;
  bool rate_;
  std::list<Buffer<float>> floats_;
  std::list<Buffer<double>> doubles_;
  std::list<Buffer<uint32_t>> pairs_;
  std::list<Buffer<int32_t>> indices_;
  int64_t bytes_ = 0;
};

/// An instance's scene and arrays on a device.
class InstanceStore {
 public:
  InstanceStore(Device device, const ModelTable& model, InstanceTable table, int64_t steps_per_frame,
                InstanceState* state);
  InstanceView view() const { return view_; }
  /// Room for what changes from frame to frame: poses of scripted obstacles and velocities of scripted particles in all
  /// steps of a frame.
  std::size_t frame_bytes() const { return frame_layout().bytes; }
  /// Where these will lie on the device.
  void place_frame(std::byte* device);
  /// These in the frame from `time` [s] on.
  void fill_frame(double time, double dt, std::byte* host) const;
  InstanceState start() const;
  int64_t bytes() const { return bytes_; }

 private:
  struct FrameLayout {
    std::size_t start = 0, end = 0, moves = 0, scripts = 0, bytes = 0;
  };
  FrameLayout frame_layout() const;
  void set_particles(const ModelTable& model);
  void set_elastic(const ModelTable& model);
  template <typename T>
  T* make(Buffer<T>& buffer, std::size_t n) {
    buffer = Buffer<T>(device_, n);
    if (n > 0) buffer.fill_zero();
    bytes_ += static_cast<int64_t>(n * sizeof(T));
    return buffer.data();
  }
  template <typename T>
  const T* keep(Buffer<T>& buffer, const std::vector<T>& values) {
    buffer = Buffer<T>(device_, 0);
    buffer.upload(values);
    bytes_ += static_cast<int64_t>(values.size() * sizeof(T));
    return buffer.data();
  }

  Device device_;
  InstanceTable table_;
  int64_t steps_;
  mpm::MovingObstacles<float> moving_;
  mpm::ObstacleNodes<float> obstacle_nodes_;
  InstanceView view_{};
  int64_t bytes_ = 0;
  Buffer<float> point_mass_, point_volume_, sums_;
  Buffer<int32_t> point_script_, sample_script_, point_material_, groups_, weighed_;
  Buffer<uint32_t> group_points_;
  Buffer<float> weight_;
  Buffer<mpm::MaterialParameters<float>> materials_;
  Buffer<long long> block_mark_;
  Buffer<uint8_t> sample_still_, lost_, point_taken_;
  Buffer<double> parameters_, map_rows_, coefficient_, earlier_, rate_, ahead_, slope_, reached_, gram_, curve_;
  Buffer<NormalEquations> equations_;
  Buffer<WaySums> ways_;
};

struct BeginFrame {
  InstanceState* states;
  GRAUPEL_HD void operator()(int64_t i) const {
    states[i].step = 0;
    states[i].residual = states[i].down_weighted = 0;
  }
};

template <typename Backend>
class DeviceRunOn final : public DeviceRun {
 public:
  DeviceRunOn(const ModelTable& model, std::vector<InstanceTable> tables, const RunSettings& settings)
      : settings_(settings),
        model_(backend_.device(), model),
        states_(backend_.device(), tables.size()),
        views_(backend_.device(), 0),
        frame_(backend_.device(), 0),
        frame_data_(backend_.device(), 0) {
    for (std::size_t i = 0; i < tables.size(); ++i) {
      instances_.emplace_back(backend_.device(), model, std::move(tables[i]), settings.steps_per_frame,
                              states_.data() + i);
      host_.push_back(instances_.back().start());
    }
    place_frames();
    std::vector<InstanceView> views;
    for (const InstanceStore& instance : instances_) views.push_back(instance.view());
    views_.upload(views);
    states_.upload(host_);
    set_view();
    backend_.wait();
  }

  void advance_frame() override {
    begin_frame();
    run_steps(settings_.steps_per_frame);
    for (int64_t i = 0; i < settings_.steps_per_frame; ++i) time_ += settings_.dt;
    backend_.read(states_.data(), host_.size(), host_.data());
  }
  double timed_steps(int64_t steps) override {
    GRAUPEL_ASSERT(steps <= settings_.steps_per_frame);
    begin_frame();
    prepare_graphs(steps);
    const double seconds = backend_.timed([&] { run_steps(steps); });
    for (int64_t i = 0; i < steps; ++i) time_ += settings_.dt;
    backend_.read(states_.data(), host_.size(), host_.data());
    return seconds;
  }
  std::vector<KernelTime> kernel_times(int times) override {
    std::vector<KernelTime> all;
    const std::vector<Kernel>& kernels = kernels_of_step();
    for (int k = 0; k < static_cast<int>(kernels.size()); ++k) {
      const Kernel& kernel = kernels[static_cast<std::size_t>(k)];
      backend_.record(first_kernel + k, [&] {
        for (int i = 0; i < times; ++i) (backend_.*kernel.launch)(view_);
      });
      begin_frame();
      backend_.play(first_kernel + k);
      all.push_back({kernel.name, backend_.timed([&] { backend_.play(first_kernel + k); }) / times});
    }
    return all;
  }
  const InstanceState& state(int instance) const override { return host_[static_cast<std::size_t>(instance)]; }
  std::vector<float> frame(int instance) const override {
    const auto n = static_cast<std::size_t>(6 * view_.model.particles);
    frame_.resize_discard(n);
    backend_.write_frame(view_, instance, frame_.data());
    std::vector<float> host(n);
    backend_.read(frame_.data(), n, host.data());
    return host;
  }
  int64_t bytes() const override {
    int64_t sum = model_.bytes();
    for (const InstanceStore& instance : instances_) sum += instance.bytes();
    return sum;
  }
  const RunView& view() const { return view_; }
  Backend& backend() { return backend_; }
  /// The parts of a step, for tests.
  void begin_frame() {
    std::byte* at = frame_host_.data();
    for (const InstanceStore& instance : instances_) {
      instance.fill_frame(time_, settings_.dt, at);
      at += instance.frame_bytes();
    }
    if (!frame_host_.empty()) backend_.write(frame_host_.data(), frame_host_.size(), frame_data_.data());
    backend_.launch(view_.instance_count, BeginFrame{states_.data()});
  }
  void step() {
    for (const Kernel& kernel : kernels_of_step()) (backend_.*kernel.launch)(view_);
  }

 private:
  /// Steps of the longer one of the two graphs: a frame's, where these are not too many.
  int64_t graph_steps() const { return std::min<int64_t>(settings_.steps_per_frame, 64); }
  enum Segment { one_step, many_steps, first_kernel };

  /// One copy a frame serves all instances.
  void place_frames() {
    std::size_t bytes = 0;
    for (const InstanceStore& instance : instances_) bytes += instance.frame_bytes();
    frame_host_.resize(bytes);
    frame_data_.resize_discard(bytes);
    std::byte* at = frame_data_.data();
    for (InstanceStore& instance : instances_) {
      instance.place_frame(at);
      at += instance.frame_bytes();
    }
  }

  struct Kernel {
    const char* name;
    void (Backend::*launch)(const RunView&);
  };
  const std::vector<Kernel>& kernels_of_step() const {
    static const std::vector<Kernel> with_stress = {{"branch", &Backend::branch},
                                                    {"decode", &Backend::decode},
                                                    {"gather", &Backend::gather},
                                                    {"fit", &Backend::fit}},
                                     alone = {{"prepare", &Backend::prepare},
                                              {"decode", &Backend::decode_elastic},
                                              {"gather and project", &Backend::gather_and_project}};
    return view_.model.deformation_alone ? alone : with_stress;
  }

  void set_view() {
    view_.model = model_.view();
    view_.instances = views_.data();
    view_.instance_count = static_cast<int>(instances_.size());
    view_.dt = settings_.dt;
    view_.pull = settings_.pull;
    view_.curve_step = settings_.curve_step;
    view_.contact_weight = static_cast<float>(settings_.contact_weight);
    const auto blocks_for = [](int items) { return (items + step_warps - 1) / step_warps; };
    // A few blocks a multiprocessor, shared by the instances; but no more than there is work for.
    const int blocks_per_instance = std::max(4, 4 * backend_.processors() / view_.instance_count);
    view_.worker_blocks = std::max(1, std::min(blocks_per_instance, blocks_for(view_.model.points)));
    view_.decode_blocks = view_.model.deformation_alone
                              ? std::max(1, std::min(blocks_per_instance, view_.model.point_groups()))
                              : std::max(1, view_.worker_blocks - 1);  // beside that of the equations
    view_.gather_blocks = std::max(1, blocks_for(view_.model.samples));
  }
  void prepare_graphs(int64_t steps) {
    if (steps >= graph_steps()) backend_.record(many_steps, [&] { steps_now(graph_steps()); });
    backend_.record(one_step, [&] { steps_now(1); });
  }
  void steps_now(int64_t steps) {
    for (int64_t i = 0; i < steps; ++i) step();
  }
  void run_steps(int64_t steps) {
    prepare_graphs(steps);
    for (; steps >= graph_steps(); steps -= graph_steps()) backend_.play(many_steps);
    for (; steps > 0; --steps) backend_.play(one_step);
  }

  RunSettings settings_;
  mutable Backend backend_;
  ModelStore model_;
  std::list<InstanceStore> instances_;
  Buffer<InstanceState> states_;
  Buffer<InstanceView> views_;
  mutable Buffer<float> frame_;
  Buffer<std::byte> frame_data_;  ///< of all instances (InstanceStore::fill_frame)
  std::vector<std::byte> frame_host_;
  std::vector<InstanceState> host_;
  RunView view_{};
  double time_ = 0;
};

}  // namespace graupel::rom::device

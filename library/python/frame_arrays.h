// Frames of a trajectory as Python sees them: one by one, and a quantity of all as an array that is read when indexed.
#pragma once

#include <memory>
#include <vector>

#include "library/python/trajectory_frames.h"

namespace graupel::python {

using Frames = std::vector<std::shared_ptr<const ParticleFrame>>;

/// A frame with arrays over its own memory.
struct PyFrame {
  std::shared_ptr<const ParticleFrame> frame;
};

/// One quantity of all frames: [frames, particles, ..].
struct FrameArrays {
  PyTrajectory trajectory;
  Quantity quantity;
  ParticleField wanted = ParticleField::stress;

  nb::object of_frame(const std::shared_ptr<const ParticleFrame>& frame) const;
  /// That of one frame, or of a slice.
  nb::object get(const nb::object& index) const;
  /// NumPy's protocol: of all frames in an array of their own. Raises ValueError where `copy` is False.
  nb::object as_array(const nb::object& dtype, const nb::object& copy) const;
  nb::tuple shape() const;
};

/// The frame of a whole number. Raises TypeError for anything else, IndexError for a frame that is not there.
std::shared_ptr<const ParticleFrame> frame_at(const PyTrajectory& trajectory, nb::handle number, FieldSet wanted = {});
/// Those of a slice, in its order.
Frames frames_in(const PyTrajectory& trajectory, const nb::slice& slice, FieldSet wanted = {});

void bind_frame_arrays(nb::module_& module);

}  // namespace graupel::python

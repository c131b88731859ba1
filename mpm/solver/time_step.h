// Step size: fixed, or from the sound speed of the present state and the speeds of particles and scripted bodies,
//   1/dt = (max |v| + max |u| + max c) / (courant dx) + 6 nu / dx^2, between min_step and max_step,
// whose second term is the limit of explicit diffusion of the momentum by the kinematic viscosity nu in three
// dimensions. Yield and Herschel-Bulkley flow are implicit and set no limit of their own. Or settled for a frame at its
// start, from the speeds alone.
#pragma once

#include "core/scene/scene.h"

namespace graupel::mpm {

/// Fastest motion, wave and diffusion of a state.
struct StateSpeeds {
  double speed = 0;        ///< max |v| [m/s]
  double sound_speed = 0;  ///< max c [m/s]
  double diffusivity = 0;  ///< max nu [m^2/s]
  double scripted = 0;     ///< max |u| of moving obstacles [m/s]
  double fall = 0;         ///< that gravity adds in a frame [m/s]
};

/// Largest step that the policy allows for this state [s]; for the policies of equal steps the frame's equal share.
/// Throws DivergedError when a frame of equal steps would need over a million.
double largest_step(const TimeStep& policy, double dx, double frame_time, const StateSpeeds& speeds);

/// Step to take with `left` seconds of the frame to go: equal shares of the rest, so that no sliver remains.
/// Throws DivergedError when the frame would need over a million steps, ConfigError where the policy's courant number
/// or largest step is the reason.
double next_step(const TimeStep& policy, double dx, double frame_time, const StateSpeeds& speeds, double left);

/// Throws ConfigError when a fixed step lets a scripted body or an emitted particle of `speed` [m/s] cross over one
/// cell.
void check_scripted_speed(const Scene& scene, double speed);

/// Largest stable step at a Courant number of 0.3 [s]; infinite for a state at rest without waves.
double usual_step(double dx, const StateSpeeds& speeds);
/// Step that a run which diverged with steps of `dt` should try [s]: the usual one of the state before, which may be
/// half broken, so between dt/8 and dt/2.
double suggested_step(double dx, const StateSpeeds& speeds, double dt);

}  // namespace graupel::mpm

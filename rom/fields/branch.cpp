#include "rom/fields/branch.h"

#include <algorithm>

#include "core/system/error.h"

namespace graupel::rom {

std::vector<double> map_input(const LatentState& state, int inputs) {
  std::vector<double> z = state.latent;
  if (static_cast<std::size_t>(inputs) > z.size()) z.insert(z.end(), state.parameters.begin(), state.parameters.end());
  GRAUPEL_ASSERT(z.size() == static_cast<std::size_t>(inputs));
  return z;
}

void ClosureBranch::coefficients(const double* latent, double* a) const {
  std::copy_n(latent, latents_, a);
  if (closure_->outputs() > 0) closure_->evaluate(latent, a + latents_);
}

void ClosureBranch::jacobian(const double* latent, double* jacobian) const {
  std::fill_n(jacobian, latents_ * latents_, 0.0);
  for (int j = 0; j < latents_; ++j) jacobian[j * latents_ + j] = 1;
  if (closure_->outputs() > 0) closure_->derivative(latent, latents_, jacobian + latents_ * latents_);
}

void MapBranch::coefficients(const LatentState& state, double* a) const {
  map_->evaluate(map_input(state, map_->inputs()).data(), a);
}

void RateBranch::coefficients(const LatentState& state, double* a) const {
  std::vector<double> rows(static_cast<std::size_t>(map_->outputs()));
  map_->evaluate(map_input(state, map_->inputs()).data(), rows.data());
  for (int k = 0; k < count(); ++k) {
    a[k] = 0;
    for (int j = 0; j < latents_; ++j)
      a[k] += rows[static_cast<std::size_t>(k * latents_ + j)] * state.velocity[static_cast<std::size_t>(j)];
  }
}

}  // namespace graupel::rom

// Branches: what multiplies the spatial modes of a factored field, f(X; s) = mean(X) + sum_k W_k(X) a_k(s), as a
// function of the latent state s = (q, q', mu).
#pragma once

#include <concepts>
#include <memory>
#include <utility>

#include "rom/fields/coefficient_map.h"
#include "rom/projection/latent_state.h"

namespace graupel::rom {

/// A map that branches share.
class SharedMap {
 public:
  SharedMap(std::shared_ptr<const BranchMap> map) : map_(std::move(map)) {}
  template <std::derived_from<BranchMap> Map>
  SharedMap(Map map) : map_(std::make_shared<const Map>(std::move(map))) {}
  const BranchMap& operator*() const { return *map_; }
  const BranchMap* operator->() const { return map_.get(); }

 private:
  std::shared_ptr<const BranchMap> map_;
};

class Branch {
 public:
  virtual ~Branch() = default;
  virtual int count() const = 0;  ///< of modes
  /// a(s), [count].
  virtual void coefficients(const LatentState& state, double* a) const = 0;
  virtual const BranchMap& map() const = 0;
};

/// Deformation: the first r coefficients are the latent itself, the others follow from it.
///   a(q) = (q_1 .. q_r, c_1(q) ..)
class ClosureBranch final : public Branch {
 public:
  ClosureBranch(int latents, SharedMap closure) : latents_(latents), closure_(std::move(closure)) {}
  int count() const override { return latents_ + closure_->outputs(); }
  void coefficients(const LatentState& state, double* a) const override { coefficients(state.latent.data(), a); }
  void coefficients(const double* latent, double* a) const;
  /// da/dq, [count, r].
  void jacobian(const double* latent, double* jacobian) const;
  int latents() const { return latents_; }
  const BranchMap& map() const override { return *closure_; }

 private:
  int latents_;
  SharedMap closure_;
};

/// Stress, and the paper's affine velocity l(X, q): a(q, mu).
class MapBranch final : public Branch {
 public:
  explicit MapBranch(SharedMap map) : map_(std::move(map)) {}
  int count() const override { return map_->outputs(); }
  void coefficients(const LatentState& state, double* a) const override;
  const BranchMap& map() const override { return *map_; }

 private:
  SharedMap map_;
};

/// Affine velocity: a = M(q, mu) q'. C is a velocity gradient, so it scales with the speed along the manifold.
class RateBranch final : public Branch {
 public:
  RateBranch(int latents, SharedMap map) : latents_(latents), map_(std::move(map)) {}
  int count() const override { return map_->outputs() / latents_; }
  void coefficients(const LatentState& state, double* a) const override;
  const BranchMap& map() const override { return *map_; }

 private:
  int latents_;
  SharedMap map_;  ///< outputs [count, r]
};

/// (q, mu), the input of maps.
std::vector<double> map_input(const LatentState& state, int inputs);

}  // namespace graupel::rom

// Executes the plan of a graph network (graph/plan/layer_plan.h) on libtorch tensors, for a batch of scenes; the
// gradient is libtorch's autograd. Internal, as device_batch.h.
//
// First layers over [f_sender, f_receiver, e] are evaluated once a node and gathered, W_s f_s + W_r f_r + W_e e; with
// FirstLayers::whole once a link in libtorch's own operations alone, as the papers write them.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "train/networks/device_batch.h"
#include "train/networks/torch_layers.h"

namespace graupel::train {

/// A set of links on the device.
struct TorchLinks {
  int64_t count = 0;
  LinkEnd sender, receiver;
  at::Tensor weight;  ///< [links]; undefined: 1
  at::Tensor offset;  ///< [links, 3]; undefined where there is none
};

class TorchEngine {
 public:
  /// Weights as views of `flat`, which lives elsewhere and may change. With `checkpoint_stages` k > 0 only the values
  /// between every k-th message-passing iteration are kept for the backward pass, and those between are computed again.
  TorchEngine(const ParameterLayout& layout, const at::Tensor& flat, int64_t checkpoint_stages = 0);

  /// The sets of links of a batch, each made when first asked for.
  class LinkCache {
   public:
    explicit LinkCache(const DeviceBatch& batch) : batch_(batch) {}
    const TorchLinks& of(const graph::Links& links);
    const DeviceBatch& batch() const { return batch_; }

   private:
    const DeviceBatch& batch_;
    std::vector<std::pair<graph::Links, std::unique_ptr<TorchLinks>>> made_;
  };

  /// What an operation of a plan computes: its output, from the values of its sources.
  struct Context {
    const TorchEngine& engine;
    const graph::PlanOperation& operation;
    const DeviceBatch& batch;
    const std::vector<at::Tensor>& values;
    graph::FirstLayers first_layers;
    LinkCache& cache;
    const TorchLinks& links() const;  ///< of the operation
    const at::Tensor& source(std::size_t i) const;
    const graph::PlanLayer& layer() const;  ///< of the operation
    /// A weight of the operation's layer: parameter(".layer1.weight").
    const at::Tensor& parameter(const std::string& name) const;
    const at::Tensor& embedding() const;  ///< [types, width]
  };
  using Operation = std::function<at::Tensor(const Context&)>;
  /// Teaches the engine an operation, before the first pass.
  void add_operation(const std::string& kind, Operation operation) { operations_[kind] = std::move(operation); }

  /// Normalised accelerations [particles, 3 k], without a gradient.
  at::Tensor forward(const DeviceBatch& batch, graph::FirstLayers first_layers = graph::FirstLayers::split) const;

  /// The same, and the gradient of every weight into `gradient` (flat, as the weights). `gradient_of` gives the
  /// gradient of the loss by the accelerations, from these.
  void backward(const DeviceBatch& batch, const at::Tensor& gradient,
                const std::function<at::Tensor(const at::Tensor&)>& gradient_of) const;

  const at::Tensor& weights() const { return flat_; }
  /// A weight, a leaf of autograd.
  const at::Tensor& parameter(const std::string& name) const { return parameters_[index_.at(name)]; }
  /// An FCN of the plan over rows; autograd follows it where it is on.
  at::Tensor fcn(const graph::PlanLayer& layer, const at::Tensor& input) const;

 private:
  const graph::LayerPlan& plan() const { return layout_.plan(); }
  const graph::PlanLayer& layer_of(const graph::PlanOperation& op) const {
    return plan().layers[static_cast<std::size_t>(op.layer)];
  }
  /// Inputs of the plan; the others are undefined.
  std::vector<at::Tensor> given(const DeviceBatch& batch) const;
  /// Operations begin .. end; values that none after them reads are let go where there is no gradient.
  void run(LinkCache& links, std::size_t begin, std::size_t end, std::vector<at::Tensor>& values,
           graph::FirstLayers first_layers) const;
  at::Tensor gather(const Context& context) const;
  at::Tensor behind_first(const graph::PlanLayer& layer, at::Tensor hidden) const;
  at::Tensor first_layer_of_links(const graph::PlanLayer& layer, const Context& context, const TorchLinks& links) const;
  /// The first operations of the parts between checkpoints, and the end.
  std::vector<std::size_t> parts() const;

  ParameterLayout layout_;
  at::Tensor flat_;
  int64_t checkpoint_stages_;
  std::vector<at::Tensor> parameters_;  ///< leaves of autograd, in the layout's order
  std::map<std::string, std::size_t> index_;
  std::map<std::string, Operation> operations_;
  std::vector<std::size_t> last_use_;  ///< of each value: the last operation that reads it
};

}  // namespace graupel::train

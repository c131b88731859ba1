#include "graph/plan/plan_description.h"

namespace graupel::graph {

namespace {

std::string name_of(int value) { return "f" + std::to_string(value); }

std::string inputs_of(const LayerPlan& plan, const PlanOperation& op) {
  std::string text;
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : ", ") + part; };
  for (const PlanSource& source : op.sources) {
    const bool is_gather = op.kind == operation::gather;
    const char* const end = !is_gather                    ? ""
                            : source.end == End::sender   ? " of the sender"
                            : source.end == End::receiver ? " of the receiver"
                                                          : "";
    add(name_of(source.value) + end);
  }
  if (op.kind == operation::encode) add("embedding [" + std::to_string(plan.embedding) + "]");
  if (op.offset) add("offset [3]");
  if (op.residual >= 0) text += "; + " + name_of(op.residual);
  if (op.scale != 1) text += "; scaled";
  return text;
}

/// Tensors of a layer: first to last, without the names of weight and bias.
std::string tensors_of(const LayerPlan& plan, const PlanOperation& op) {
  if (op.layer < 0) return "";
  const std::string& layer = plan.layers[static_cast<std::size_t>(op.layer)].name;
  std::string text;
  for (const PlanTensor& tensor : plan.tensors()) {
    if (!tensor.name.starts_with(layer + ".")) continue;
    const std::string rest = tensor.name.substr(layer.size() + 1);
    if (rest != "weight" && rest != "bias" && !rest.starts_with("layer") && !rest.starts_with("norm")) continue;
    if (tensor.name.ends_with("bias")) continue;  // [outputs] beside each weight
    if (text.empty())
      text.append("`").append(layer).append("`: ");
    else
      text += ", ";
    if (rest == "norm.weight")
      text += "norm";
    else
      text.append("[")
          .append(std::to_string(tensor.shape[0]))
          .append(", ")
          .append(std::to_string(tensor.shape[1]))
          .append("]");
  }
  return text;
}

}  // namespace

std::string description_of(const LayerPlan& plan) {
  std::string text =
      "| value | operation | rows | width | inputs | layer and its matrices |\n|---|---|---|---|---|---|\n";
  const auto row = [&](int value, const std::string& operation, const std::string& inputs, const std::string& tensors) {
    const PlanValue& made = plan.values[static_cast<std::size_t>(value)];
    text += "| " + name_of(value) + " | " + operation + " | " + text_of(made.rows, " ") + " | " +
            std::to_string(made.width) + " | " + inputs + " | " + tensors + " |\n";
  };
  for (int i = 0; i < plan.inputs; ++i) row(i, i == 0 ? "features" : "features of edges", "", "");
  for (const PlanOperation& op : plan.operations) row(op.output, op.kind, inputs_of(plan, op), tensors_of(plan, op));
  return text;
}

}  // namespace graupel::graph

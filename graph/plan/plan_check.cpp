// Whether rows, widths and order of a plan fit, and whether an engine knows its operations.
#include <algorithm>
#include <set>

#include "core/system/error.h"
#include "graph/plan/layer_plan.h"

namespace graupel::graph {

namespace {

/// What an operation reads and writes, held against the plan.
class Checker {
 public:
  explicit Checker(const LayerPlan& plan) : plan_(plan) {}

  void check() {
    for (number_ = 0; number_ < plan_.operations.size(); ++number_) check(plan_.operations[number_]);
    if (used_.size() != plan_.layers.size()) fail("some layer is used by no operation");
    if (!plan_.blocks.empty()) check_blocks();
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    std::string place = "plan '" + plan_.name + "'";
    if (number_ < plan_.operations.size()) {
      const PlanOperation& op = plan_.operations[number_];
      place += ", operation " + std::to_string(number_) + " (" + op.kind;
      if (op.layer >= 0 && op.layer < static_cast<int>(plan_.layers.size()))
        place += " '" + plan_.layers[static_cast<std::size_t>(op.layer)].name + "'";
      place += ")";
    }
    throw ConfigError(place + ": " + what);
  }

  const PlanValue& value(int index) const {
    if (index < 0 || index >= plan_.inputs + static_cast<int>(number_))
      fail("value " + std::to_string(index) + " is not there yet (allowed: 0 to " +
           std::to_string(plan_.inputs + static_cast<int>(number_) - 1) + ")");
    return plan_.values.at(static_cast<std::size_t>(index));
  }
  void expect_rows(const Rows& found, const Rows& wanted) const {
    if (!(found == wanted)) fail("a source has rows of " + text_of(found) + ", wanted " + text_of(wanted));
  }

  void check(const PlanOperation& op) {
    const int next = plan_.inputs + static_cast<int>(number_);
    if (op.output != next)
      fail("writes value " + std::to_string(op.output) + ", not the next, " + std::to_string(next));
    if (plan_.values.size() <= static_cast<std::size_t>(op.output)) fail("its value is not declared");
    const PlanValue& out = plan_.values[static_cast<std::size_t>(op.output)];
    int64_t inputs = op.kind == operation::encode ? plan_.embedding : 0;
    for (const PlanSource& source : op.sources) {
      const PlanValue& in = value(source.value);
      inputs += in.width;
      if (op.kind == operation::gather)
        expect_rows(in.rows, source.end == End::sender     ? op.links.sender()
                             : source.end == End::receiver ? op.links.receiver()
                                                           : op.links.rows());
      else if (op.kind == operation::aggregate)
        expect_rows(in.rows, op.links.rows());
      else if (op.kind == operation::decode)
        expect_rows(in.rows, {RowSet::particles, 0});
      else if (op.kind == operation::encode || op.kind == operation::update || op.kind == operation::add)
        expect_rows(in.rows, out.rows);
    }
    if (op.offset) inputs += op.links.offset();
    if (op.residual >= 0) {
      const PlanValue& residual = value(op.residual);
      expect_rows(residual.rows, out.rows);
      if (residual.width != out.width) fail("adds a value of another width");
    }
    if (op.layer >= 0) check_layer(op, inputs, out.width);
  }

  void check_layer(const PlanOperation& op, int64_t inputs, int64_t outputs) {
    if (op.layer >= static_cast<int>(plan_.layers.size()))
      fail("layer " + std::to_string(op.layer) + " is not there (allowed: 0 to " +
           std::to_string(plan_.layers.size() - 1) + ")");
    const PlanLayer& layer = plan_.layers[static_cast<std::size_t>(op.layer)];
    if (!used_.insert(op.layer).second) fail("the layer is used twice");
    if (layer.inputs != inputs)
      fail("the layer takes " + std::to_string(layer.inputs) + " numbers a row, its sources give " +
           std::to_string(inputs));
    if (layer.outputs != outputs)
      fail("the layer gives " + std::to_string(layer.outputs) + " numbers a row, its value has " +
           std::to_string(outputs));
  }

  void check_blocks() {
    std::size_t block = 0;
    int64_t gathers = 0;
    for (number_ = 0; number_ < plan_.operations.size(); ++number_) {
      const PlanOperation& op = plan_.operations[number_];
      if (op.kind != operation::gather) continue;
      if (block < plan_.blocks.size() && gathers == plan_.blocks[block].iterations) {
        ++block;
        gathers = 0;
      }
      if (block == plan_.blocks.size() || !(op.links == plan_.blocks[block].links))
        fail("its links are not those of block " + std::to_string(block));
      ++gathers;
    }
    if (block + 1 != plan_.blocks.size() || gathers != plan_.blocks[block].iterations)
      fail("block " + std::to_string(block) + " has fewer gathers than it says");
  }

  const LayerPlan& plan_;
  std::size_t number_ = 0;
  std::set<int> used_;
};

}  // namespace

void LayerPlan::check() const { Checker(*this).check(); }

void check_operations(const LayerPlan& plan, const std::string& engine, const std::vector<std::string>& known) {
  for (const PlanOperation& op : plan.operations) {
    if (std::find(known.begin(), known.end(), op.kind) != known.end()) continue;
    std::string words;
    for (const std::string& word : known) words += (words.empty() ? "" : ", ") + word;
    throw ConfigError("engine '" + engine + "' has no operation '" + op.kind + "', which plan '" + plan.name +
                      "' needs (it has: " + words + "). Teach it the operation, or choose another engine");
  }
}

}  // namespace graupel::graph

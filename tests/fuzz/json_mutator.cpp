#include "tests/fuzz/json_mutator.h"

#include <iterator>
#include <vector>

namespace graupel::fuzz {

namespace {

constexpr const char* edges[] = {"0",
                                 "-0.0",
                                 "1",
                                 "-1",
                                 "2",
                                 "3",
                                 "0.5",
                                 "1e-9",
                                 "1e-40",
                                 "1e-320",
                                 "1e9",
                                 "1e18",
                                 "1e30",
                                 "1e39",
                                 "1e300",
                                 "1e308",
                                 "-1e30",
                                 "-1e308",
                                 "255",
                                 "65536",
                                 "1000000",
                                 "2147483647",
                                 "2147483648",
                                 "-2147483648",
                                 "4294967296",
                                 "9007199254740993",
                                 "9223372036854775807",
                                 "9223372036854775808",
                                 "-9223372036854775808",
                                 "18446744073709551615"};

std::size_t below(std::size_t n, Random& random) { return random() % n; }

/// Every value of the tree, the root first.
void collect(Json& node, std::vector<Json*>& all) {
  all.push_back(&node);
  if (node.is_structured())
    for (Json& child : node) collect(child, all);
}

Json new_value(const Json& old, const std::vector<Json*>& all, Random& random) {
  switch (below(8, random)) {
    case 0:
      return *all[below(all.size(), random)];  // of another place
    case 1:
      return nullptr;
    case 2:
      return below(2, random) == 0;
    case 3:
      return "";
    case 4:
      return Json::array();
    case 5:
      if (old.is_number()) {
        constexpr double factors[] = {-1, 0.1, 0.5, 0.999, 1.001, 2, 10, 1000, 1e6};
        return old.get<double>() * factors[below(std::size(factors), random)];
      }
      if (old.is_string()) return mutate_bytes(old.get<std::string>(), old.get_ref<const std::string&>().size() + 8);
      [[fallthrough]];
    default:
      return Json::parse(edge_number(random));
  }
}

void change_members(Json& node, const std::vector<Json*>& all, Random& random) {
  const auto one = [&] { return std::next(node.begin(), static_cast<std::ptrdiff_t>(below(node.size(), random))); };
  const Json copy = *all[below(all.size(), random)];
  switch (below(3, random)) {
    case 0:
      node.erase(one());
      return;
    case 1:  // one more, of another place or its own
      if (node.is_array())
        node.push_back(below(2, random) == 0 ? Json(*one()) : copy);
      else
        node[mutate_bytes(one().key(), 40)] = copy;
      return;
    default:
      *one() = copy;
  }
}

}  // namespace

std::string edge_number(Random& random) { return edges[below(std::size(edges), random)]; }

void mutate_json(Json& root, Random& random) {
  std::vector<Json*> all;
  collect(root, all);
  Json& node = *all[below(all.size(), random)];
  if (node.is_structured() && !node.empty())
    change_members(node, all, random);
  else
    node = new_value(Json(node), all, random);
}

std::string mutate_json_text(const std::string& text, std::size_t most, Random& random) {
  Json root = Json::parse(text, nullptr, false, true);
  if (below(4, random) == 0 || root.is_discarded()) return mutate_bytes(text, most);
  for (std::size_t changes = 1 + below(3, random); changes > 0; --changes) mutate_json(root, random);
  return root.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace graupel::fuzz

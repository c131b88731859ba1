// Values at given times, with straight lines between them: from the one at time 0, after the last one constant.
#pragma once

#include <vector>

namespace graupel {

/// The keys around a time, and how far it lies from the first to the second. A key has a `time` [s].
template <typename Key>
struct KeyPair {
  Key before, after;
  double fraction = 0;
};

/// `initial` is the key at time 0; `keys` are in the order of time, all later.
template <typename Key>
KeyPair<Key> keys_around(const Key& initial, const std::vector<Key>& keys, double time) {
  KeyPair<Key> pair{initial, initial};
  for (const Key& key : keys) {
    pair.after = key;
    if (key.time > time) break;
    pair.before = key;
  }
  const double span = pair.after.time - pair.before.time;
  pair.fraction = span > 0 ? (time - pair.before.time) / span : 0;
  return pair;
}

}  // namespace graupel

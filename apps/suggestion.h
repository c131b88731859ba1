// "Did you mean ...?" for flags and verbs.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace graupel::apps {

/// Names of an app's verbs and flags ("--seed").
std::vector<std::string> known_words(const CLI::App& app);
/// The known word closest to `word`, empty when none is close (edit distance over a third of its length).
std::string closest_word(const std::string& word, const std::vector<std::string>& known);

}  // namespace graupel::apps

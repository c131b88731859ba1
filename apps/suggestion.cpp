#include "apps/suggestion.h"

#include "core/edit_distance.h"

namespace graupel::apps {

std::vector<std::string> known_words(const CLI::App& app) {
  std::vector<std::string> words;
  for (const CLI::App* verb : app.get_subcommands({})) words.push_back(verb->get_name());
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) words.push_back("--" + name);
  return words;
}

std::string closest_word(const std::string& word, const std::vector<std::string>& known) {
  return closest_of(word.substr(0, word.find('=')), known);
}

}  // namespace graupel::apps

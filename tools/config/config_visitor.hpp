#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "excitation/words/words.hpp"
#include "tools/config/yaml_document.hpp"

namespace stageid {

enum class Presence : std::uint8_t { optional, required };
inline constexpr Presence kOptional = Presence::optional;
inline constexpr Presence kRequired = Presence::required;

/// Allowed numbers; all must be finite.
struct NumberRule {
  std::string_view unit;  ///< for people; empty: none
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_excluded = false;
};

inline constexpr NumberRule positive(std::string_view unit) {
  return {unit, 0.0, std::numeric_limits<double>::infinity(), true};
}
inline constexpr NumberRule not_negative(std::string_view unit) { return {unit, 0.0}; }
inline constexpr NumberRule any_number(std::string_view unit) { return {unit}; }

/// Allowed number of entries of a list.
struct CountRule {
  std::size_t least = 0;
  std::size_t most = std::numeric_limits<std::size_t>::max();
};

/// A value that may have several forms.
struct FlexibleValue {
  std::string word;                  ///< set if the value is a word
  std::vector<double> numbers = {};  ///< one entry for a bare number
  bool is_list = false;              ///< the numbers are in brackets
  std::vector<std::pair<double, double>> pairs = {};
};

/// Allowed forms of a FlexibleValue.
struct FlexibleRule {
  std::vector<std::string> words = {};  ///< allowed words
  bool any_text = false;                ///< or any text, described by `text_meaning`
  std::string_view text_meaning = {};
  bool number = false;
  bool list = false;
  bool pairs = false;    ///< list of [number, number]
  NumberRule rule = {};  ///< of every number
};

/// The value of a key in a file.
struct ConfigValue;

/// The single description of a configuration: functions `describe(ConfigVisitor&, Config&)` name every key once. A
/// reader fills the values from a file; a schema printer prints type, unit, range and default, the initial value.
class ConfigVisitor {
 public:
  using Describe = std::function<void(ConfigVisitor&)>;
  virtual ~ConfigVisitor() = default;

  void number(const char* key, double& value, const NumberRule& rule, Presence presence,
              const char* help);
  void numbers(const char* key, std::vector<double>& values, const NumberRule& rule,
               CountRule count, Presence presence, const char* help);
  void integer(const char* key, std::int64_t& value, std::int64_t low, std::int64_t high,
               Presence presence, const char* help);
  void text(const char* key, std::string& value, Presence presence, const char* help);
  void texts(const char* key, std::vector<std::string>& values, CountRule count, Presence presence,
             const char* help);
  /// `index` into `names`.
  void choice(const char* key, std::size_t& index, const std::vector<std::string>& names,
              Presence presence, const char* help);
  void flexible(const char* key, FlexibleValue& value, const FlexibleRule& rule, Presence presence,
                const char* help);
  /// A map with arbitrary names as keys.
  void named_numbers(const char* key, std::vector<std::pair<std::string, double>>& values,
                     const NumberRule& rule, Presence presence, const char* help);
  void named_texts(const char* key, std::vector<std::pair<std::string, std::string>>& values,
                   Presence presence, const char* help);
  /// A map with described keys.
  void group(const char* key, const Describe& describe, Presence presence, const char* help);
  /// A map with described keys, or a text.
  void group_or_text(const char* key, const Describe& describe, std::string& text,
                     Presence presence, const char* help);
  /// A list of maps; `describe_item` is called once per item.
  void items(const char* key, const Describe& describe_item, CountRule count, Presence presence,
             const char* help);
  /// A rule between values: unless `holds`, reports an error at `key`. Ignored for a schema.
  virtual void require(bool holds, const char* key, const std::string& message) = 0;

 protected:
  struct Key {
    const char* key;
    Presence presence;
    const char* help;
    std::string type;
    std::string default_value;
    std::string range = {};
    std::string_view unit = {};
    const Describe* inner = nullptr;  ///< of a map, or of each item
  };
  /// Calls take() with the value if the file has one.
  virtual void visit(const Key& key, const std::function<void(const ConfigValue&)>& take) = 0;
};

/// Fills a configuration from a document. Every key must be known, every required key must be present, and every value
/// must have its type and range.
/// @throws FormatErrors, each "FILE:LINE:COLUMN: problem; remedy".
void read_config(const YamlDocument& document, const ConfigVisitor::Describe& describe);

/// choice() among the words of an enumeration.
template <HasWords Enum>
void choose(ConfigVisitor& visitor, const char* key, Enum& value, Presence presence,
            const char* help) {
  auto index = static_cast<std::size_t>(value);
  visitor.choice(key, index, words_of<Enum>(), presence, help);
  value = static_cast<Enum>(index);
}

/// group() whose keys fill one object.
template <typename Keys>
void group(ConfigVisitor& visitor, const char* key, void (*describe)(ConfigVisitor&, Keys&),
           Keys& keys, Presence presence, const char* help) {
  visitor.group(
      key, [&](ConfigVisitor& inner) { describe(inner, keys); }, presence, help);
}

/// items() that each add an element to a list.
template <typename List>
void items(ConfigVisitor& visitor, const char* key, void (*describe)(ConfigVisitor&, List&),
           List& list, CountRule count, Presence presence, const char* help) {
  visitor.items(
      key, [&](ConfigVisitor& item) { describe(item, list); }, count, presence, help);
}

/// integer() for a value of another integer type.
template <typename Integer>
void count(ConfigVisitor& visitor, const char* key, Integer& value, std::int64_t low,
           std::int64_t high, Presence presence, const char* help) {
  auto wide = static_cast<std::int64_t>(value);
  visitor.integer(key, wide, low, high, presence, help);
  value = static_cast<Integer>(wide);
}

}  // namespace stageid

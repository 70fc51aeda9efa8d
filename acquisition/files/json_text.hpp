#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace stageid {

/// JSON whose processing would exhaust the stack (recursion by level) or the patience of the user (time by the square
/// of an object's keys).
class JsonTooLarge : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A callback for Json::parse() that bounds what it accepts. @throws JsonTooLarge
template <class Json>
class JsonBounds {
 public:
  static constexpr int kMostLevels = 100;
  static constexpr std::size_t kMostKeys = 4000;

  bool operator()(int depth, typename Json::parse_event_t event, const Json&) {
    using Event = typename Json::parse_event_t;
    if (depth > kMostLevels) throw JsonTooLarge("nested deeper than 100 levels");
    if (event == Event::object_start) {
      keys_.resize(static_cast<std::size_t>(depth) + 1);
      keys_.push_back(0);
    }
    if (event == Event::key && ++keys_[depth] > kMostKeys)
      throw JsonTooLarge("more than 4000 keys in one object");
    return true;
  }

 private:
  std::vector<std::size_t> keys_;  ///< of the open objects, by depth
};

/// External JSON; discarded if it is not JSON or too large.
template <class Json>
Json parse_json(std::string_view text) {
  try {
    return Json::parse(text.begin(), text.end(), JsonBounds<Json>(), false);
  } catch (const JsonTooLarge&) {
    return Json(Json::value_t::discarded);
  }
}

/// The same; an empty object unless it is an object.
template <class Json>
Json parse_json_object(std::string_view text) {
  Json json = parse_json<Json>(text);
  return json.is_object() ? json : Json::object();
}

/// In one line. Bytes that are not UTF-8 are replaced, because names and texts come from files of others.
template <class Json>
std::string json_line(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace stageid

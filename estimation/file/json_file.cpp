#include "estimation/file/json_file.hpp"

#include <cmath>
#include <limits>

#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/json_text.hpp"

namespace stageid {
namespace {

/// "LINE:COLUMN", which only the library's text contains: "parse error at line 417, column 3: ...".
std::string place_of(const nlohmann::ordered_json::parse_error& error) {
  unsigned line = 0;
  unsigned column = 0;
  const char* const at = std::strstr(error.what(), "at line ");
  if (at == nullptr || std::sscanf(at, "at line %u, column %u", &line, &column) != 2) return "";
  return std::to_string(line) + ":" + std::to_string(column);
}

}  // namespace

JsonNode JsonNode::member(const std::string& key) const {
  if (!value_.is_object()) fail("must be an object with \"" + key + "\"");
  const auto found = value_.find(key);
  if (found == value_.end()) fail("\"" + key + "\" is missing");
  return {file_, (place_ == "/" ? "" : place_) + "/" + key, *found};
}

std::vector<JsonNode> JsonNode::elements() const {
  if (!value_.is_array()) fail("must be a list");
  std::vector<JsonNode> out;
  std::size_t i = 0;
  for (const nlohmann::ordered_json& element : value_)
    out.emplace_back(file_, place_ + "/" + std::to_string(i++), element);
  return out;
}

std::vector<JsonNode> JsonNode::elements_of(const std::string& key) const {
  return has(key) ? member(key).elements() : std::vector<JsonNode>();
}

double JsonNode::number() const {
  if (!value_.is_number()) fail("must be a number");
  const auto number = value_.get<double>();
  if (!std::isfinite(number)) fail("must be a finite number");
  return number;
}

double JsonNode::positive() const {
  const double value = number();
  if (!(value > 0.0)) fail("must be positive");
  return value;
}

double JsonNode::number_or(const std::string& key, double fallback) const {
  return has(key) && !member(key).raw().is_null() ? member(key).number() : fallback;
}

std::optional<double> JsonNode::optional_number(const std::string& key) const {
  return has(key) ? std::optional(member(key).number()) : std::nullopt;
}

std::string JsonNode::text_or_empty(const std::string& key) const {
  return has(key) ? member(key).text() : std::string();
}

long long JsonNode::integer(long long lowest, long long highest) const {
  if (!value_.is_number_integer()) fail("must be a whole number");
  const auto number = value_.get<long long>();
  if (number < lowest || number > highest)
    fail("is " + std::to_string(number) + "; must be " +
         (lowest == highest ? std::to_string(lowest)
                            : "a whole number from " + std::to_string(lowest) + " to " +
                                  std::to_string(highest)));
  return number;
}

std::string JsonNode::text() const {
  if (!value_.is_string()) fail("must be a string in quotes");
  return value_.get<std::string>();
}

std::vector<double> JsonNode::numbers() const {
  std::vector<double> out;
  for (const JsonNode& node : elements()) out.push_back(node.number());
  return out;
}

std::vector<double> JsonNode::numbers_or_null() const {
  std::vector<double> out;
  for (const JsonNode& node : elements())
    out.push_back(node.raw().is_null() ? std::numeric_limits<double>::quiet_NaN() : node.number());
  return out;
}

std::vector<std::string> JsonNode::texts() const {
  std::vector<std::string> out;
  for (const JsonNode& node : elements()) out.push_back(node.text());
  return out;
}

JsonFile::JsonFile(std::filesystem::path file, const std::string& format) : file_(std::move(file)) {
  const std::string text = read_whole_file(file_);
  if (text.empty())
    throw FormatError(file_, "", "is empty; expected a JSON file of format " + format);
  const std::string wanted =
      format == "stageid-model" ? "a model (.json)" : "a " + format + " file (.json)";
  const auto refuse_other_kind = [&] {
    const std::string other = other_kind(file_, wanted);
    if (!other.empty()) throw FormatError(file_, "", other);
  };
  if (!text.starts_with('{')) refuse_other_kind();
  try {
    value_ = nlohmann::ordered_json::parse(text, JsonBounds<nlohmann::ordered_json>());
  } catch (const JsonTooLarge& error) {
    throw FormatError(file_, "", std::string(error.what()) + "; give " + wanted);
  } catch (const nlohmann::ordered_json::out_of_range& error) {
    const std::string what = error.what();  // ... number overflow parsing '1e999'
    const std::size_t start = what.find('\'');
    throw FormatError(file_, "",
                      "contains a number out of range for double precision" +
                          (start == std::string::npos ? "" : ": " + what.substr(start)));
  } catch (const nlohmann::ordered_json::parse_error& error) {
    throw FormatError(file_, place_of(error),
                      "is not JSON, or is truncated; check brackets, quotes and commas up to here, "
                      "or give " +
                          wanted);
  }
  const JsonNode node = root();
  if (!value_.is_object() || !node.has("format") || !value_["format"].is_string() ||
      value_["format"] != format) {
    if (node.has("format")) refuse_other_kind();
    throw FormatError(file_, "",
                      "is not a " + format + " file; its \"format\" must be \"" + format + "\"");
  }
}

}  // namespace stageid

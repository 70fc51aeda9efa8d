#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/files/file_error.hpp"

namespace stageid {

/// A node of an untrusted JSON file: every access is checked, and every error names file and place.
class JsonNode {
 public:
  JsonNode(const std::filesystem::path& file, std::string place,
           const nlohmann::ordered_json& value)
      : file_(file), place_(std::move(place)), value_(value) {}

  bool has(const std::string& key) const { return value_.is_object() && value_.contains(key); }
  JsonNode member(const std::string& key) const;
  std::vector<JsonNode> elements() const;
  std::vector<JsonNode> elements_of(const std::string& key) const;  ///< empty if it is missing
  double number() const;                                            ///< finite
  double positive() const;                                          ///< > 0
  /// An optional member; null is the same as missing and is written for unknown numbers.
  double number_or(const std::string& key, double fallback) const;
  std::optional<double> optional_number(const std::string& key) const;  ///< not null if it is there
  std::string text_or_empty(const std::string& key) const;
  long long integer(long long lowest, long long highest) const;
  std::string text() const;
  std::vector<double> numbers() const;
  std::vector<double> numbers_or_null() const;  ///< null: NaN
  std::vector<std::string> texts() const;
  const nlohmann::ordered_json& raw() const noexcept { return value_; }
  [[noreturn]] void fail(const std::string& what) const { throw FormatError(file_, place_, what); }

 private:
  const std::filesystem::path& file_;
  std::string place_;
  const nlohmann::ordered_json& value_;
};

/// A JSON file with a checked "format".
class JsonFile {
 public:
  /// @throws FileError, FormatError
  JsonFile(std::filesystem::path file, const std::string& format);
  JsonFile(JsonFile&&) = delete;
  JsonNode root() const { return {file_, "/", value_}; }

 private:
  std::filesystem::path file_;
  nlohmann::ordered_json value_;
};

}  // namespace stageid

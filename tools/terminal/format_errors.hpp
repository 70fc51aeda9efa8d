#pragma once

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "acquisition/files/file_error.hpp"

namespace stageid {

/// All errors of a file and those it refers to; as a FormatError it is the first one.
class FormatErrors : public FormatError {
 public:
  /// @pre `all` is not empty
  explicit FormatErrors(std::vector<FormatError> all)
      : FormatError(all.front()), all_(std::move(all)) {}
  const std::vector<FormatError>& all() const noexcept { return all_; }

 private:
  std::vector<FormatError> all_;
};

/// Executes several actions and collects their errors.
class FormatErrorList {
 public:
  /// Larger lists are not useful; a hostile file could cause any number.
  static constexpr std::size_t kMost = 100;

  /// Does nothing after kMost errors.
  template <typename Work>
  void attempt(Work work) {
    if (errors_.size() >= kMost) return;
    try {
      work();
    } catch (const FormatErrors& errors) {
      for (const FormatError& error : errors.all()) add(error);
    } catch (const FormatError& error) {
      add(error);
    }
  }
  std::size_t size() const noexcept { return errors_.size(); }
  /// @throws FormatErrors if there are any
  void raise() const {
    if (!errors_.empty()) throw FormatErrors(errors_);
  }

 private:
  /// A node with YAML aliases is read at each of them, and its errors are the same.
  void add(const FormatError& error) {
    const auto same = [&](const FormatError& other) {
      return std::string_view(other.what()) == error.what();
    };
    if (std::ranges::none_of(errors_, same)) errors_.push_back(error);
  }
  std::vector<FormatError> errors_;
};

}  // namespace stageid

#pragma once

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
      errors_.insert(errors_.end(), errors.all().begin(), errors.all().end());
    } catch (const FormatError& error) {
      errors_.push_back(error);
    }
  }
  std::size_t size() const noexcept { return errors_.size(); }
  /// @throws FormatErrors if there are any
  void raise() const {
    if (!errors_.empty()) throw FormatErrors(errors_);
  }

 private:
  std::vector<FormatError> errors_;
};

}  // namespace stageid

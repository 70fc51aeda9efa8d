#pragma once

#include <utility>
#include <vector>

#include "acquisition/files/file_error.hpp"

namespace stageid {

/// All that is wrong with a file and those it names; as a FormatError it is the first.
class FormatErrors : public FormatError {
 public:
  /// @pre there is one
  explicit FormatErrors(std::vector<FormatError> all)
      : FormatError(all.front()), all_(std::move(all)) {}
  const std::vector<FormatError>& all() const noexcept { return all_; }

 private:
  std::vector<FormatError> all_;
};

/// Does one thing after the other and keeps what is wrong with each.
class FormatErrorList {
 public:
  /// More than anybody reads; a hostile file could have any number.
  static constexpr std::size_t kMost = 100;

  /// Nothing more once there are kMost.
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
  bool empty() const noexcept { return errors_.empty(); }
  std::size_t size() const noexcept { return errors_.size(); }
  /// @throws FormatErrors if there is one
  void raise() const {
    if (!errors_.empty()) throw FormatErrors(errors_);
  }

 private:
  void add(const FormatError& error) { errors_.push_back(error); }

  std::vector<FormatError> errors_;
};

}  // namespace stageid

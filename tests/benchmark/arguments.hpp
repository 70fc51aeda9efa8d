#pragma once

#include <cstdlib>

namespace stageid::test {

/// The arguments of a study by their place; those that are not there have a default.
class Arguments {
 public:
  Arguments(int argc, char** argv) : argc_(argc), argv_(argv) {}

  const char* word(int i, const char* otherwise) const { return i < argc_ ? argv_[i] : otherwise; }
  template <typename Number>
  Number operator()(int i, Number otherwise) const {
    return i < argc_ ? static_cast<Number>(std::atof(argv_[i])) : otherwise;
  }

 private:
  int argc_;
  char** argv_;
};

}  // namespace stageid::test

#include "tools/exchange/matlab/mat_option.hpp"

#include <string>

namespace stageid {

void add_mat_version(CLI::App& command, MatVersion& version) {
  command
      .add_option_function<std::string>(
          "--mat-version",
          [&version](const std::string& text) {
            version = text == "5" ? MatVersion::v5 : MatVersion::v73;
          },
          "version of a .mat file: 5 or 7.3 (HDF5)")
      ->check(CLI::IsMember({"5", "7.3"}))
      ->default_str("5");
}

}  // namespace stageid

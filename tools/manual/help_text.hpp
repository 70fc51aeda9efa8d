#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <string>

namespace stageid {

/// The help of a command, from the parser, wrapped at a width. Values have names: --band HZ HZ.
class HelpText : public CLI::Formatter {
 public:
  explicit HelpText(std::size_t width) : width_(width) {}
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_subcommand(const CLI::App* command) const override;

 private:
  std::string entry(const std::string& head, const std::string& text) const;
  std::size_t width_;
};

/// Columns of the terminal at stdout, at most 120; 100 without a terminal.
std::size_t help_columns();

}  // namespace stageid

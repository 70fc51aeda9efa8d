#pragma once

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "excitation/threads/team.hpp"
#include "excitation/words/words.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

enum class Verbosity : std::uint8_t { quiet, normal, debug };
template <>
inline constexpr std::array kWords<Verbosity> = {"quiet", "normal", "debug"};

/// Output of a command, and who executes it: results on stdout (a text, or with --json one object), messages and progress on stderr.
class Console {
 public:
  Verbosity verbosity = Verbosity::normal;
  bool json = false;
  int exit_code = 0;                ///< of the executed command
  const Team* team = &Team::one();  ///< of the processes that execute it

  /// A line of the result; not printed with --json.
  void result(const std::string& line) const;
  void result(const char* line) const { result(std::string(line)); }
  /// The whole result with --json; else nothing.
  void result(const Json& object) const;
  void message(const std::string& line) const;  ///< unless quiet
  void warning(const std::string& line) const;  ///< always

  // The same with a formatted line.
  template <typename Part, typename... Parts>
  void result(fmt::format_string<Part, Parts...> line, Part&& part, Parts&&... parts) const {
    result(fmt::format(line, std::forward<Part>(part), std::forward<Parts>(parts)...));
  }
  template <typename Part, typename... Parts>
  void message(fmt::format_string<Part, Parts...> line, Part&& part, Parts&&... parts) const {
    message(fmt::format(line, std::forward<Part>(part), std::forward<Parts>(parts)...));
  }
  template <typename Part, typename... Parts>
  void warning(fmt::format_string<Part, Parts...> line, Part&& part, Parts&&... parts) const {
    warning(fmt::format(line, std::forward<Part>(part), std::forward<Parts>(parts)...));
  }
};

/// Shows the progress of a long step: a bar with rate and remaining time on a terminal, else a plain line every few
/// seconds. Nothing when quiet. At most ten updates per second.
class Progress {
 public:
  /// `unit` is that of the rate, e.g. "MB"; `scale` converts the numbers of update() to it.
  Progress(const Console& console, std::string label, std::string unit, double scale = 1.0);
  ~Progress();
  Progress(Progress&&) = delete;

  /// `total` 0: unknown; then neither share nor remaining time are shown.
  void update(double done, double total, const std::string& note = "");
  double seconds() const;

 private:
  using Clock = std::chrono::steady_clock;
  void draw(double done, double total, const std::string& note);

  const Console& console_;
  std::string label_;
  std::string unit_;
  double scale_;
  bool terminal_;
  bool drawn_ = false;
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_ = Clock::now();
};

/// Formats rows as columns, numbers right-aligned; the first row is the head.
std::vector<std::string> table_lines(const std::vector<std::vector<std::string>>& rows);

}  // namespace stageid

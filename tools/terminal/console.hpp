#pragma once

#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace stageid {

enum class Verbosity : std::uint8_t { quiet, normal, debug };

/// Where a command speaks: results on stdout (a text, or with --json one object), messages and
/// progress on stderr.
class Console {
 public:
  Verbosity verbosity = Verbosity::normal;
  bool json = false;
  int exit_code = 0;  ///< of the command that ran

  /// A line of the result; not printed with --json.
  void result(const std::string& line) const;
  void result(const char* line) const { result(std::string(line)); }
  /// The whole result with --json; else nothing.
  void result(const nlohmann::ordered_json& object) const;
  void message(const std::string& line) const;  ///< normal and debug
  void detail(const std::string& line) const;   ///< debug
  void warning(const std::string& line) const;  ///< always
};

/// Shows how far a long step is: a bar with rate and time left on a terminal, else a plain line every
/// few seconds. Nothing when quiet. Never more than ten updates a second.
class Progress {
 public:
  /// `unit` is that of the rate, e.g. "MB"; `scale` turns update()'s numbers into it.
  Progress(const Console& console, std::string label, std::string unit, double scale = 1.0);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `total` 0: nobody knows how much there is; then no share and no time left are shown.
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

/// Lays rows out in columns: numbers to the right, the first row is the head.
std::vector<std::string> table_lines(const std::vector<std::vector<std::string>>& rows);

}  // namespace stageid

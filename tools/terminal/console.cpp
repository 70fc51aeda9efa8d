#include "tools/terminal/console.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <system_error>

#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

constexpr std::chrono::milliseconds kRedraw(100);
constexpr std::chrono::seconds kPlainLine(5);

std::string duration(double seconds) {
  if (!std::isfinite(seconds)) return "?";
  const auto whole = static_cast<long long>(std::ceil(std::max(0.0, seconds)));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

/// Characters, not bytes.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

/// Whether the terminal can erase a line; else progress is shown as plain lines.
bool redraws_lines() {
  const char* terminal = std::getenv("TERM");
  return isatty(STDERR_FILENO) != 0 && terminal != nullptr && std::string_view(terminal) != "dumb";
}

bool numeric(const std::string& text) {
  return !text.empty() && (text[0] == '-' || text[0] == '+' || (text[0] >= '0' && text[0] <= '9'));
}

/// Names in foreign files may contain control characters, which a terminal would obey: they are shown as \x1B.
std::string shown(const std::string& text) {
  std::string plain;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const auto byte = static_cast<unsigned char>(text[k]);
    const auto next = static_cast<unsigned char>(k + 1 < text.size() ? text[k + 1] : '\0');
    const bool c1 = byte == 0xC2 && next >= 0x80 && next < 0xA0;  // 0x80 to 0x9F in UTF-8
    if (c1) ++k;
    if (c1 || (byte < ' ' && byte != '\n' && byte != '\t') || byte == 0x7F)
      plain += fmt::format("\\x{:02X}", c1 ? next : byte);
    else
      plain += text[k];
  }
  return plain;
}

/// Writes to stderr. A closed terminal is not a reason to abort the work.
template <typename... Values>
void tell(fmt::format_string<Values...> format, Values&&... values) {
  static_cast<void>(
      std::fputs(fmt::format(format, std::forward<Values>(values)...).c_str(), stderr));
}

/// Writes to stdout. A failed write is an error, except for a closed terminal: that is an interrupt and keeps its exit
/// code.
template <typename... Values>
void print_result(fmt::format_string<Values...> format, Values&&... values) {
  try {
    fmt::print(stdout, format, std::forward<Values>(values)...);
  } catch (const std::system_error&) {
    if (!interrupt_flag()) throw;
  }
}

}  // namespace

void Console::result(const std::string& line) const {
  if (!json) print_result("{}\n", shown(line));
}
void Console::result(const Json& object) const {
  // Names from foreign files may contain anything: invalid UTF-8 is replaced instead of an exception.
  if (json) print_result("{}\n", object.dump(2, ' ', false, Json::error_handler_t::replace));
}
void Console::message(const std::string& line) const {
  if (verbosity >= Verbosity::normal) tell("{}\n", shown(line));
}
void Console::warning(const std::string& line) const {
  std::string one_line = shown(line);
  std::replace(one_line.begin(), one_line.end(), '\n', ' ');
  tell("stageid: {}\n", one_line);
}

Progress::Progress(const Console& console, std::string label, std::string unit, double scale)
    : console_(console),
      label_(std::move(label)),
      unit_(std::move(unit)),
      scale_(scale),
      terminal_(redraws_lines()) {}

Progress::~Progress() {
  if (terminal_ && drawn_) tell("\r\x1b[K");
}

double Progress::seconds() const {
  return std::chrono::duration<double>(Clock::now() - start_).count();
}

void Progress::update(double done, double total, const std::string& note) {
  if (console_.verbosity == Verbosity::quiet) return;
  const Clock::time_point now = Clock::now();
  if (now - last_ < (terminal_ ? Clock::duration(kRedraw) : Clock::duration(kPlainLine))) return;
  last_ = now;
  draw(done, total, note);
}

void Progress::draw(double done, double total, const std::string& note) {
  const double elapsed = seconds();
  const std::string tail = note.empty() ? "" : "  " + note;
  std::string line;
  if (!(total > 0.0)) {
    line = fmt::format("{}: {:.0f} s  {:.0f} {}{}", label_, elapsed, done * scale_, unit_, tail);
  } else {
    const double share = std::clamp(done / total, 0.0, 1.0);
    const double left = share > 0.0 ? elapsed * (1.0 - share) / share : std::nan("");
    const double rate = elapsed > 0.0 ? done * scale_ / elapsed : 0.0;
    constexpr int kWidth = 24;
    const int full = static_cast<int>(std::lround(share * kWidth));
    line = terminal_ ? fmt::format("{} [{:#<{}}{:.<{}}]", label_, "", full, "", kWidth - full)
                     : label_ + ":";
    line += fmt::format(" {:3.0f} %  {:.4g} {}/s  {} left{}", 100.0 * share, rate, unit_,
                        duration(left), tail);
  }
  if (terminal_)
    tell("\r{}\x1b[K", line);
  else
    tell("{}\n", line);
  std::fflush(stderr);
  drawn_ = true;
}

std::vector<std::string> table_lines(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width(row[i]));
  }
  // A column is aligned by its first body cell: numbers to the right, words to the left.
  std::vector<bool> right(widths.size(), false);
  for (std::size_t i = 0; i < widths.size(); ++i)
    for (std::size_t r = 1; r < rows.size() && !right[i]; ++r)
      right[i] = i < rows[r].size() && numeric(rows[r][i]);
  std::vector<std::string> lines;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string pad(widths[i] - width(row[i]), ' ');
      line += (i == 0 ? "" : "  ") + (right[i] ? pad + row[i] : row[i] + pad);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace stageid

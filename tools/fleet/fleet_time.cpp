#include "tools/fleet/fleet_time.hpp"

#include <chrono>
#include <regex>

namespace stageid {

std::optional<double> days_of(const std::string& time_utc) {
  static const std::regex form(
      R"((\d{4})-(\d\d)-(\d\d)(?:T([01]\d|2[0-3]):([0-5]\d):([0-5]\d(?:\.\d{1,9})?)Z?)?)");
  std::smatch parts;
  if (!std::regex_match(time_utc, parts, form)) return std::nullopt;
  const auto number = [&](std::size_t part) {
    return parts[part].matched ? std::stod(parts[part].str()) : 0.0;
  };
  const std::chrono::year_month_day date{std::chrono::year(static_cast<int>(number(1))),
                                         std::chrono::month(static_cast<unsigned>(number(2))),
                                         std::chrono::day(static_cast<unsigned>(number(3)))};
  if (!date.ok()) return std::nullopt;
  return static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count()) +
         (number(4) + (number(5) + number(6) / 60.0) / 60.0) / 24.0;
}

}  // namespace stageid

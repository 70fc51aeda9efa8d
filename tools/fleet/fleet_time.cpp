#include "tools/fleet/fleet_time.hpp"

#include <chrono>
#include <cstdio>

namespace stageid {

std::optional<double> days_of(const std::string& time_utc) {
  int year = 0, hour = 0, minute = 0;
  unsigned month = 0, day = 0;
  double second = 0.0;
  if (std::sscanf(time_utc.c_str(), "%d-%u-%uT%d:%d:%lf", &year, &month, &day, &hour, &minute,
                  &second) < 3)
    return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month),
                                         std::chrono::day(day)};
  if (!date.ok()) return std::nullopt;
  return static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count()) +
         (hour + (minute + second / 60.0) / 60.0) / 24.0;
}

}  // namespace stageid

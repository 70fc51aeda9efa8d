#include "tools/fleet/fleet_series.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "frf/statistics/order_statistic.hpp"
#include "tools/report/report_encoding.hpp"

namespace stageid {
namespace {

constexpr double kMostSteps = 30000.0;

std::uint16_t sign_last(int value) {
  return static_cast<std::uint16_t>(value < 0 ? -2 * value - 1 : 2 * value);
}

/// Eight bytes from 16 hexadecimal digits; others count as zero.
void append_hex(std::vector<std::uint8_t>& bytes, std::string hex) {
  hex.resize(16, '0');
  for (std::size_t i = 0; i < 16; i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::strtol(hex.substr(i, 2).c_str(), nullptr, 16)));
}

}  // namespace

void FleetSeries::add_identification(double day, unsigned char verdict, unsigned char folder,
                                     const std::string& job) {
  minutes_.push_back(std::round(day * 24.0 * 60.0));
  verdict_.push_back(verdict);
  folder_.push_back(folder);
  append_hex(job_, job);
}

nlohmann::json FleetSeries::add_track(const std::vector<std::uint8_t>& present,
                                      const std::vector<double>& frequency_hz,
                                      const std::vector<double>& frequency_std_hz) {
  const auto [least, most] = std::ranges::minmax(frequency_hz);
  std::vector<double> std_hz = frequency_std_hz;
  const double step = std::max({median(std_hz) / 4.0, (most - least) / kMostSteps, 1e-12 * most});
  int before = 0;
  for (const double hz : frequency_hz) {
    const int place = static_cast<int>(std::lround((hz - least) / step));
    change_.push_back(sign_last(place - before));
    before = place;
  }
  present_.insert(present_.end(), present.begin(), present.end());
  std_hz_.insert(std_hz_.end(), frequency_std_hz.begin(), frequency_std_hz.end());
  return {{"least", least}, {"step", step}, {"seen", frequency_hz.size()}};
}

std::vector<report::Block> FleetSeries::blocks(nlohmann::json& arrays) const {
  std::vector<report::Block> out;
  const auto add = [&](const char* id, const char* type, std::string text) {
    arrays[id]["type"] = type;
    out.push_back({id, std::move(text)});
  };
  add("minutes", "f64",
      report::encode_float64(
          Eigen::Map<const Eigen::VectorXd>(minutes_.data(), std::ssize(minutes_))));
  add("verdict", "u8", report::packed(verdict_));
  add("folder", "u8", report::packed(folder_));
  add("job", "u8", report::packed(job_));
  add("present", "u8", report::packed(present_));
  add("change", "i16", report::packed(report::byte_planes(change_)));
  const report::LogBytes deviation = report::encode_log_bytes(
      Eigen::Map<const Eigen::MatrixXd>(std_hz_.data(), 1, std::ssize(std_hz_)));
  arrays["std"] = {{"low", deviation.low}, {"step", deviation.step}};
  add("std", "log8", deviation.text);
  return out;
}

}  // namespace stageid

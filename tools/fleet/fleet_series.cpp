#include "tools/fleet/fleet_series.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "frf/statistics/order_statistic.hpp"
#include "tools/fleet/fleet_jobs.hpp"
#include "tools/report/report_encoding.hpp"

namespace stageid {
namespace {

constexpr int kNoisy = 4;  // level of compression
constexpr double kMostSteps = 30000.0;

std::uint16_t sign_last(int value) {
  return static_cast<std::uint16_t>(value < 0 ? -2 * value - 1 : 2 * value);
}

/// Eighths of an octave from 2^-16.
std::uint8_t std_code(double ratio) {
  return static_cast<std::uint8_t>(std::clamp(std::lround(8.0 * std::log2(ratio)) + 128, 1L, 255L));
}

/// Six bytes from 12 hexadecimal digits; others count as zero.
void append_hex(std::vector<std::uint8_t>& bytes, std::string hex) {
  hex.resize(kFolderDigits, '0');
  for (std::size_t i = 0; i < hex.size(); i += 2)
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
  const double step = std::max({median(std_hz) / 3.0, (most - least) / kMostSteps, 1e-12 * most});
  int before = 0;
  for (const double hz : frequency_hz) {
    const int place = static_cast<int>(std::lround((hz - least) / step));
    change_.push_back(sign_last(place - before));
    before = place;
  }
  present_.insert(present_.end(), present.begin(), present.end());
  for (const double value : frequency_std_hz)
    std_.push_back(value > 0.0 ? std_code(value / step) : std::uint8_t{0});
  return {frequency_hz.size(), least, step};
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
  add("change", "i16", report::packed(report::byte_planes(change_), kNoisy));
  add("std", "u8", report::packed(std_, kNoisy));
  return out;
}

}  // namespace stageid

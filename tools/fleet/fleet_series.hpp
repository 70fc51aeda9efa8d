#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/report/html_page.hpp"

namespace stageid {

/// The numbers of the page of a fleet, packed. tools/fleet/js/series.js is the reader.
class FleetSeries {
 public:
  /// One identification. @param folder index of the folder of its job's folder; 255: no results
  void add_identification(double day, unsigned char verdict, unsigned char folder,
                          const std::string& job);

  /// The frequencies of one mode of a stage. They are rounded to a third of the median standard deviation, or to
  /// 1/30000 of their range if that is larger, and stored as differences of neighbours. Standard deviations are rounded
  /// by at most 5 %.
  /// @param present per identification of the stage
  /// @return number of values, least value and step, for the page
  nlohmann::json add_track(const std::vector<std::uint8_t>& present,
                           const std::vector<double>& frequency_hz,
                           const std::vector<double>& frequency_std_hz);

  /// @param arrays descriptions for the page, per block
  std::vector<report::Block> blocks(nlohmann::json& arrays) const;

 private:
  std::vector<double> minutes_;
  std::vector<std::uint8_t> verdict_;
  std::vector<std::uint8_t> folder_;
  std::vector<std::uint8_t> job_;
  std::vector<std::uint8_t> present_;
  std::vector<std::uint16_t> change_;
  std::vector<std::uint8_t> std_;
};

}  // namespace stageid

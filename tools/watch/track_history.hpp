#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace stageid {

/// What was tracked since the start, at a bounded number of times for a picture: when there are more, every second one
/// is dropped.
class TrackHistory {
 public:
  static constexpr std::size_t kMost = 256;

  /// @param time_s increasing
  void add(double time_s, const Eigen::VectorXd& change, const Eigen::VectorXd& deviation);
  /// {"time_s": [P], "change": [q x P], "deviation": [q x P]}, with five digits
  std::string json() const;

 private:
  struct Row {
    double time_s;
    Eigen::VectorXd change;
    Eigen::VectorXd deviation;
  };
  std::vector<Row> rows_;
  std::size_t every_ = 1;  ///< of these, one is kept
  std::size_t added_ = 0;
};

}  // namespace stageid

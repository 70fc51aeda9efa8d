#pragma once

#include <Eigen/Core>

namespace stageid {

/// The step of a converter, from its values in double precision: the greatest common divisor of their differences.
class ValueGrid {
 public:
  /// Takes the first few thousand samples.
  void add(const Eigen::Ref<const Eigen::VectorXd>& samples) noexcept;
  void add(const ValueGrid& other) noexcept;

  /// 0 if the values have no common step above 1e-6 of the largest one, or if they are all the same.
  double step() const noexcept { return continuous_ ? 0.0 : step_; }

 private:
  void take(double value) noexcept;
  void divide(double difference) noexcept;

  bool continuous_ = false;
  int taken_ = 0;
  double last_ = 0.0;
  double largest_ = 0.0;
  double step_ = 0.0;
};

}  // namespace stageid

#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/model/basis.hpp"

namespace stageid {

/// The derivatives of the response of a model behind the exact hold to its parameters, on given lines. The parameters
/// and their order are those of FitCovariance: denominator coefficients, free delays, vec B (channels x functions).
class ResponseGradient {
 public:
  /// @param parameters rows of the covariance; the number of free delays follows from it
  /// @throws std::invalid_argument if the model cannot have as many parameters, or has no sample rate
  ResponseGradient(const AdditiveModel& model, Eigen::Index parameters,
                   const Eigen::VectorXd& frequency_hz);

  /// d g / d parameters, parameters x functions, of functions g of the response on line k.
  /// @param weights dg = sum_c weights(c) dP_c, channels x functions, channel c = output + n_y input
  Eigen::MatrixXcd of(Eigen::Index k, const Eigen::MatrixXcd& weights) const;

  Eigen::Index parameters() const noexcept { return parameters_; }

 private:
  /// Channels with one delay, and the functions of every submodel with this delay.
  struct Group {
    std::vector<Eigen::Index> channels;
    std::vector<SubmodelBasis> bases;
  };
  void add_globals(const Group& group, std::size_t submodel, Eigen::Index first, Eigen::Index k,
                   const Eigen::MatrixXcd& weights, Eigen::MatrixXcd& out) const;
  void add_delay(Eigen::Index channel, const Eigen::RowVectorXcd& by_delay,
                 Eigen::MatrixXcd& out) const;

  const AdditiveModel& model_;
  Eigen::Index parameters_ = 0;
  Eigen::Index first_delay_ = 0;
  Eigen::Index delays_ = 0;
  std::vector<Group> groups_;
};

}  // namespace stageid

#pragma once

#include <string>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// If the plant is nonlinear, one sentence on where and how much; otherwise empty.
std::string nonlinearity_sentence(const FrfEstimate& frf);

/// "20 dB"; "none" for a ratio of 0.
std::string decibels(double ratio);

/// "output <- input" of a channel (row of FrfEstimate::response).
std::string pair_name(const FrfEstimate& frf, Eigen::Index channel);

/// Whether a finding about the data explains why the realizations differ (withdraw_linearity_test()).
bool is_withdrawn(const NonlinearityTest& test);

}  // namespace stageid

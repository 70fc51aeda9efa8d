#include "frf/response/nonlinearity_sentence.hpp"

#include <fmt/format.h>

#include <cmath>

#include "frf/response/nonlinearity.hpp"

namespace stageid {
namespace {

/// The channel pair and band with the largest distortion among those that test nonlinear.
std::string strongest_distortion(const FrfEstimate& frf, const NonlinearityTest& test) {
  double largest = 0.0;
  std::string text;
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b)
    for (Eigen::Index c = 0; c < test.p_value.rows(); ++c) {
      if (!(test.p_value(c, b) < kNonlinearBelow) || !(test.distortion(c, b) > largest)) continue;
      largest = test.distortion(c, b);
      text =
          fmt::format(", most at {} between {:.4g} and {:.4g} Hz ({} of the response)",
                      pair_name(frf, c), test.band_hz(b, 0), test.band_hz(b, 1), decibels(largest));
    }
  return text;
}

}  // namespace

std::string decibels(double ratio) {
  return ratio > 0.0 ? fmt::format("{:.0f} dB", 20.0 * std::log10(ratio)) : std::string("none");
}

std::string pair_name(const FrfEstimate& frf, Eigen::Index c) {
  return fmt::format("{} <- {}", frf.outputs.name(c % frf.n_outputs()),
                     frf.inputs.name(c / frf.n_outputs()));
}

bool is_withdrawn(const NonlinearityTest& test) {
  return test.settled_p_value.size() > 0 && test.settled_p_value.maxCoeff() == 0.0;
}

std::string nonlinearity_sentence(const FrfEstimate& frf) {
  const NonlinearityTest test = linearity_of(frf);
  if (!test.nonlinear()) return {};
  return fmt::format("the plant is nonlinear: realizations differ by more than noise{}",
                     strongest_distortion(frf, test));
}

}  // namespace stageid

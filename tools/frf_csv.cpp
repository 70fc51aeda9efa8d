#include "tools/frf_csv.hpp"

#include <fmt/format.h>

#include "tools/csv_table.hpp"

namespace stageid {
namespace {

std::string head_of(const FrfEstimate& frf) {
  std::string text = "frequency_hz";
  for (std::size_t j = 0; j < frf.inputs.size(); ++j)
    for (std::size_t i = 0; i < frf.outputs.size(); ++i) {
      const std::string channel = frf.outputs.names[i] + "/" + frf.inputs.names[j];
      const std::string unit = frf.outputs.units[i] + "/" + frf.inputs.units[j];
      const auto column = [&](const char* part, const std::string& of) {
        text += fmt::format(",{}", csv_field(fmt::format("{} {} [{}]", part, channel, of)));
      };
      column("real", unit);
      column("imaginary", unit);
      if (frf.noise_variance.size() > 0) column("noise_variance", fmt::format("({})^2", unit));
      if (frf.total_variance.size() > 0) column("total_variance", fmt::format("({})^2", unit));
    }
  return text;
}

}  // namespace

std::string frf_csv(const FrfEstimate& frf) {
  std::string text = fmt::format(
      "# stageid-frf, written by stageid {}; sample rate {} Hz, realizations {}, periods {}\n"
      "# of OUTPUT/INPUT, SI units; variances are E|error|^2 of the complex response\n{}\n",
      STAGEID_VERSION, frf.sample_rate_hz, frf.realizations, frf.periods, head_of(frf));
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    text += fmt::format("{}", frf.frequency_hz[k]);
    for (Eigen::Index c = 0; c < frf.response.rows(); ++c) {
      text += fmt::format(",{},{}", frf.response(c, k).real(), frf.response(c, k).imag());
      for (const Eigen::MatrixXd* variance : {&frf.noise_variance, &frf.total_variance})
        if (variance->size() > 0) text += fmt::format(",{}", (*variance)(c, k));
    }
    text += '\n';
  }
  return text;
}

}  // namespace stageid

#include "tools/exchange/model/model_csv.hpp"

#include <fmt/format.h>

#include <optional>
#include <stdexcept>

#include "acquisition/files/version.hpp"
#include "tools/exchange/arrays/csv_table.hpp"

namespace stageid {
namespace {

std::string number_or_nothing(const std::optional<double>& value) {
  return value ? fmt::format("{}", *value) : "";
}

}  // namespace

std::string model_csv(const AdditiveModel& model) {
  std::string text = fmt::format(
      "# stageid-model 1, written by stageid {}; hold {}, sample rate {} Hz\n"
      "# P(s) = sum over submodels of coefficient s^power_of_s / (s^integrators A(s)), SI units, s "
      "in rad/s\n"
      "# A(s) = 1 + 2 zeta s/omega + s^2/omega^2, or 1 where natural_frequency_hz is empty\n"
      "submodel,integrators,natural_frequency_hz,natural_frequency_std_hz,damping_ratio,"
      "damping_ratio_std,power_of_s,output,input,coefficient\n",
      version(), to_string(model.hold), model.sample_rate_hz);
  for (std::size_t index = 0; index < model.submodels.size(); ++index) {
    const Submodel& s = model.submodels[index];
    if (s.denominator.size() > 1 && !s.is_mode())
      throw std::invalid_argument(
          fmt::format("submodel {} is neither a mode nor an integrator; the .csv table cannot "
                      "represent it, export as .json or .h5",
                      index));
    const std::string head =
        s.is_mode()
            ? fmt::format("{},{},{},{},{},{}", index, s.integrators, s.natural_frequency_hz(),
                          number_or_nothing(s.natural_frequency_std_hz), s.damping_ratio(),
                          number_or_nothing(s.damping_ratio_std))
            : fmt::format("{},{},,,,", index, s.integrators);
    for (std::size_t power = 0; power < s.numerator.size(); ++power)
      for (Eigen::Index i = 0; i < model.n_outputs(); ++i)
        for (Eigen::Index j = 0; j < model.n_inputs(); ++j)
          text += fmt::format("{},{},{},{},{}\n", head, power, csv_field(model.outputs.name(i)),
                              csv_field(model.inputs.name(j)), s.numerator[power](i, j));
  }
  return text;
}

}  // namespace stageid

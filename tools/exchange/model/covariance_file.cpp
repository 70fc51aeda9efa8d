#include "tools/exchange/model/covariance_file.hpp"

#include <fmt/format.h>

#include "acquisition/files/output_file.hpp"
#include "tools/exchange/model/model_hdf5.hpp"

namespace stageid {
namespace {

std::string unit_of(const ChannelList& channels, Eigen::Index c) {
  const auto at = static_cast<std::size_t>(c);
  return at < channels.units.size() ? channels.units[at] : std::string();
}

/// Unit of B_m s^m / s^l, such that P has output over input.
std::string numerator_unit(const AdditiveModel& model, Eigen::Index y, Eigen::Index u,
                           int power_of_s) {
  const std::string ratio =
      fmt::format("({})/({})", unit_of(model.outputs, y), unit_of(model.inputs, u));
  return power_of_s == 0 ? ratio : fmt::format("{} s^{}", ratio, power_of_s);
}

/// A common delay applies to all inputs; with one per channel, that of the last output is held.
void add_delays(const AdditiveModel& model, Eigen::Index delays, std::vector<NamedParameter>& out) {
  const Eigen::VectorXd inputs = model.input_delays_s();
  if (delays == 1 && model.n_inputs() + model.n_outputs() > 2) {
    out.push_back({"input_delay_s", "s", inputs[0]});
    return;
  }
  for (Eigen::Index p = 0; p < delays; ++p) {
    const Eigen::Index y = p - model.n_inputs();
    if (y < 0)
      out.push_back({fmt::format("input_delay_s[{}]", p), "s", inputs[p]});
    else
      out.push_back({fmt::format("output_delay_s[{}]", y), "s", model.output_delays_s()[y]});
  }
}

}  // namespace

std::vector<NamedParameter> named_parameters(const FitResult& result) {
  const AdditiveModel& model = result.model;
  std::vector<NamedParameter> out, numerators;
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& s = model.submodels[i];
    for (std::size_t q = 1; q < s.denominator.size(); ++q)
      out.push_back({fmt::format("submodels[{}].denominator[{}]", i, q), fmt::format("s^{}", q),
                     s.denominator[q]});
    for (std::size_t m = 0; m < s.numerator.size(); ++m)
      for (Eigen::Index u = 0; u < model.n_inputs(); ++u)
        for (Eigen::Index y = 0; y < model.n_outputs(); ++y)
          numerators.push_back({fmt::format("submodels[{}].numerator[{}][{}][{}]", i, m, y, u),
                                numerator_unit(model, y, u, static_cast<int>(m) - s.integrators),
                                s.numerator[m](y, u)});
  }
  // The remaining rows are the free delays.
  const auto known = static_cast<Eigen::Index>(out.size() + numerators.size());
  add_delays(model, result.covariance.sandwich.rows() - known, out);
  out.insert(out.end(), numerators.begin(), numerators.end());
  return out;
}

void write_covariance(const std::filesystem::path& target, const FitResult& result,
                      const Eigen::VectorXd& frequency_hz) {
  const AdditiveModel& model = result.model;
  const FitCovariance& covariance = result.covariance;
  std::vector<std::string> names, units;
  std::vector<double> values;
  for (const NamedParameter& parameter : named_parameters(result)) {
    names.push_back(parameter.name);
    units.push_back(parameter.unit);
    values.push_back(parameter.value);
  }
  OutputFile output(target);
  Hdf5File file = Hdf5File::create(output.path(), target);
  file.write_attribute("/", "format", std::string("stageid-covariance"));
  file.write_attribute("/", "format_version", 1LL);
  file.write_attribute("/", "weighting", model.fit.weighting);
  write_channels(file, model);
  file.create_group("/parameters");
  file.write_texts("/parameters/name", names);
  file.write_texts("/parameters/unit", units);
  write_vector(file, "/parameters/value", values);
  file.create_group("/covariance");
  write_matrix(file, "/covariance/sandwich", covariance.sandwich);
  write_matrix(file, "/covariance/likelihood", covariance.likelihood);
  write_response(file, model, frequency_hz);
  write_columns<double>(file, "/response_variance", covariance.response_variance,
                        model.n_outputs());
  write_columns<double>(file, "/confidence_radius", covariance.response_radius, model.n_outputs());
  file.write_attribute("/confidence_radius", "level", 0.95);
  file.close();
  output.commit();
}

}  // namespace stageid

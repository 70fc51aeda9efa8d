#include "tools/exchange/model/covariance_file.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_kind.hpp"
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
void add_delays(const AdditiveModel& model, Eigen::Index delays, NamedParameters& out) {
  const Eigen::VectorXd inputs = model.input_delays_s();
  if (delays == 1 && model.n_inputs() + model.n_outputs() > 2)
    return out.add("input_delay_s", "s", inputs[0]);
  // Another number is that of another model.
  const Eigen::Index most = model.n_inputs() + model.n_outputs() - 1;
  for (Eigen::Index p = 0; p < std::min(delays, most); ++p) {
    const Eigen::Index y = p - model.n_inputs();
    if (y < 0)
      out.add(fmt::format("input_delay_s[{}]", p), "s", inputs[p]);
    else
      out.add(fmt::format("output_delay_s[{}]", y), "s", model.output_delays_s()[y]);
  }
}

}  // namespace

void NamedParameters::add(const std::string& name, const std::string& unit, double value) {
  names.push_back(name);
  units.push_back(unit);
  values.push_back(value);
}

NamedParameters named_parameters(const AdditiveModel& model, Eigen::Index parameters) {
  NamedParameters out;
  Eigen::Index numerators = 0;
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& s = model.submodels[i];
    for (std::size_t q = 1; q < s.denominator.size(); ++q)
      out.add(fmt::format("submodels[{}].denominator[{}]", i, q), fmt::format("s^{}", q),
              s.denominator[q]);
    numerators += std::ssize(s.numerator) * model.n_inputs() * model.n_outputs();
  }
  // The remaining rows are the free delays.
  add_delays(model, parameters - std::ssize(out.names) - numerators, out);
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& s = model.submodels[i];
    for (std::size_t m = 0; m < s.numerator.size(); ++m)
      for (Eigen::Index u = 0; u < model.n_inputs(); ++u)
        for (Eigen::Index y = 0; y < model.n_outputs(); ++y)
          out.add(fmt::format("submodels[{}].numerator[{}][{}][{}]", i, m, y, u),
                  numerator_unit(model, y, u, static_cast<int>(m) - s.integrators),
                  s.numerator[m](y, u));
  }
  return out;
}

void write_covariance(const std::filesystem::path& target, const FitResult& result,
                      const Eigen::VectorXd& frequency_hz) {
  const AdditiveModel& model = result.model;
  const FitCovariance& covariance = result.covariance;
  const NamedParameters parameters = named_parameters(model, covariance.sandwich.rows());
  OutputFile output(target);
  Hdf5File file = Hdf5File::create(output.path(), target);
  file.write_attribute("/", "format", std::string("stageid-covariance"));
  file.write_attribute("/", "format_version", 1LL);
  file.write_attribute("/", "weighting", model.fit.weighting);
  write_channels(file, model);
  file.create_group("/parameters");
  file.write_texts("/parameters/name", parameters.names);
  file.write_texts("/parameters/unit", parameters.units);
  write_vector(file, "/parameters/value", parameters.values);
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

Eigen::MatrixXd read_covariance(const std::filesystem::path& path, const AdditiveModel& model) {
  const Hdf5File file = Hdf5File::open(path);
  require_format(file, "stageid-covariance", "a covariance",
                 "write one with 'stageid fit --covariance'");
  const std::vector<double> values = file.read_reals("/parameters/value");
  const std::vector<double> sandwich = file.read_reals("/covariance/sandwich");
  if (sandwich.size() != values.size() * values.size())
    fail_format(path, "/covariance/sandwich", "has {} values for {} parameters; write it again",
                sandwich.size(), values.size());
  const auto n = static_cast<Eigen::Index>(values.size());
  if (named_parameters(model, n).values != values)
    throw FormatError(path, "/parameters/value",
                      "differs from the model; use the covariance that 'stageid fit' wrote "
                      "together with this model");
  return Eigen::Map<const Eigen::MatrixXd>(sandwich.data(), n, n);  // symmetric
}

}  // namespace stageid

#include "tools/exchange/model/covariance_file.hpp"

#include <fmt/format.h>

#include <complex>

#include "acquisition/files/hdf5_matrices.hpp"
#include "acquisition/files/output_file.hpp"
#include "frf/file/line_datasets.hpp"

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

void add_denominators(const AdditiveModel& model, ParameterNames& out) {
  for (std::size_t i = 0; i < model.submodels.size(); ++i)
    for (std::size_t q = 1; q < model.submodels[i].denominator.size(); ++q) {
      out.names.push_back(fmt::format("submodels[{}].denominator[{}]", i, q));
      out.units.push_back(fmt::format("s^{}", q));
      out.values.push_back(model.submodels[i].denominator[q]);
    }
}

/// A common delay applies to all inputs; with one per channel, that of the last output is held.
void add_delays(const AdditiveModel& model, Eigen::Index delays, ParameterNames& out) {
  const auto add = [&](std::string name, double value) {
    out.names.push_back(std::move(name));
    out.units.emplace_back("s");
    out.values.push_back(value);
  };
  const Eigen::VectorXd inputs = model.input_delays_s();
  if (delays == 1 && model.n_inputs() + model.n_outputs() > 2) {
    add("input_delay_s", inputs[0]);
    return;
  }
  for (Eigen::Index p = 0; p < delays; ++p) {
    const Eigen::Index y = p - model.n_inputs();
    if (y < 0)
      add(fmt::format("input_delay_s[{}]", p), inputs[p]);
    else
      add(fmt::format("output_delay_s[{}]", y), model.output_delays_s()[y]);
  }
}

void add_numerators(const AdditiveModel& model, ParameterNames& out) {
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& s = model.submodels[i];
    for (std::size_t m = 0; m < s.numerator.size(); ++m)
      for (Eigen::Index u = 0; u < model.n_inputs(); ++u)
        for (Eigen::Index y = 0; y < model.n_outputs(); ++y) {
          out.names.push_back(fmt::format("submodels[{}].numerator[{}][{}][{}]", i, m, y, u));
          out.units.push_back(numerator_unit(model, y, u, static_cast<int>(m) - s.integrators));
          out.values.push_back(s.numerator[m](y, u));
        }
  }
}

void write_response(Hdf5File& file, const AdditiveModel& model, const FitCovariance& covariance,
                    const Eigen::VectorXd& frequency_hz) {
  const hsize_t N = size_of(frequency_hz.size());
  const std::vector<hsize_t> shape = {N, size_of(model.n_outputs()), size_of(model.n_inputs())};
  write_vector(file, "/frequency_hz", frequency_hz);
  const Eigen::MatrixXcd P = response(model, frequency_hz, model.hold);
  file.write_complex("/response", shape,
                     to_c_order<std::complex<double>>(P, model.n_outputs()).data());
  file.write_reals("/response_variance", shape,
                   to_c_order<double>(covariance.response_variance, model.n_outputs()).data());
  file.write_reals("/confidence_radius", shape,
                   to_c_order<double>(covariance.response_radius, model.n_outputs()).data());
  file.write_attribute("/confidence_radius", "level", 0.95);
}

}  // namespace

ParameterNames parameter_names(const FitResult& result) {
  ParameterNames numerators;
  add_numerators(result.model, numerators);
  ParameterNames out;
  add_denominators(result.model, out);
  // The remaining rows are the free delays.
  const auto known = static_cast<Eigen::Index>(out.names.size() + numerators.names.size());
  add_delays(result.model, result.covariance.sandwich.rows() - known, out);
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(out.names, numerators.names);
  append(out.units, numerators.units);
  append(out.values, numerators.values);
  return out;
}

void write_covariance(const std::filesystem::path& target, const FitResult& result,
                      const Eigen::VectorXd& frequency_hz) {
  const AdditiveModel& model = result.model;
  const FitCovariance& covariance = result.covariance;
  const ParameterNames parameters = parameter_names(result);
  OutputFile output(target);
  Hdf5File file = Hdf5File::create(output.path(), target);
  file.write_attribute("/", "format", std::string("stageid-covariance"));
  file.write_attribute("/", "format_version", 1LL);
  file.write_attribute("/", "weighting", model.fit.weighting);
  file.write_texts("/inputs", model.inputs.names);
  file.write_attribute("/inputs", "unit", model.inputs.units);
  file.write_texts("/outputs", model.outputs.names);
  file.write_attribute("/outputs", "unit", model.outputs.units);
  file.create_group("/parameters");
  file.write_texts("/parameters/name", parameters.names);
  file.write_texts("/parameters/unit", parameters.units);
  write_vector(file, "/parameters/value", parameters.values);
  file.create_group("/covariance");
  write_matrix(file, "/covariance/sandwich", covariance.sandwich);
  write_matrix(file, "/covariance/likelihood", covariance.likelihood);
  write_response(file, model, covariance, frequency_hz);
  file.close();
  output.commit();
}

}  // namespace stageid

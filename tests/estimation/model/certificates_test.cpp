// Log relative errors of small problems whose solutions are known to more digits than a double has.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/model/basis.hpp"
#include "estimation/model/hold_integral.hpp"
#include "estimation/uncertainty/dense_covariance.hpp"
#include "tests/support/models/certificate.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/stages/state_space_response.hpp"

namespace stageid::test_certificates {

using Complex = std::complex<double>;
using nlohmann::json;
using test::expect_digits;

constexpr double kEps = 0x1p-53;

Eigen::VectorXd vector_of(const json& list) {
  const std::vector<double> all = test::numbers<double>(list);
  return Eigen::Map<const Eigen::VectorXd>(all.data(), std::ssize(all));
}

void append(const Eigen::MatrixXcd& values, std::vector<Complex>& out) {
  out.insert(out.end(), values.reshaped().begin(), values.reshaped().end());
}

Eigen::MatrixXcd joined(const SplitMatrix& parts) {
  return parts.re + Complex(0.0, 1.0) * parts.im;
}

TEST(Certificates, HoldIntegral) {
  for (const json& problem : test::certificates("hold_integrals")) {
    std::vector<Complex> value;
    std::vector<Complex> derivative;
    for (const Complex pole : test::numbers<Complex>(problem["poles"])) {
      const HoldIntegral found = hold_integral(pole, problem["t_s"]);
      value.push_back(found.value);
      derivative.push_back(found.derivative);
    }
    expect_digits(problem, "value", value);
    expect_digits(problem, "derivative", derivative);
  }
}

// The gradient is a sum of partial fractions. Without hold they cancel on lines far below the mode, by 1e6 to 1e7 at a
// hundredth of its frequency.
TEST(Certificates, BasisAndHold) {
  for (const json& problem : test::certificates("basis")) {
    const double rate = problem["sample_rate_hz"];
    const ModelLines lines{2.0 * std::numbers::pi * vector_of(problem["frequency_hz"]), 1.0 / rate,
                           problem["hold"] == "exact" ? HoldModel::exact : HoldModel::none};
    const Eigen::VectorXd a = vector_of(problem["a"]);
    const SubmodelShape shape{problem["integrators"], static_cast<int>(a.size()),
                              problem["numerator_degree"]};
    std::vector<Complex> value;
    std::vector<Complex> gradient;
    std::vector<Complex> delay;
    for (const double delay_s : problem["delay_s"]) {
      SubmodelBasis basis;
      evaluate_basis(HoldEquivalent(lines, delay_s), shape, a, {.gradient = true, .delay = true},
                     basis);
      append(joined(basis.value), value);
      append(joined(basis.gradient), gradient);
      append(joined(basis.delay).col(0), delay);
    }
    expect_digits(problem, "value", value);
    if (a.size() > 0)
      expect_digits(problem, "gradient", gradient,
                    {.limit = -std::log10(kEps * problem["cancellation"].get<double>())});
    expect_digits(problem, "delay", delay);
  }
}

/// The structure of a problem, with its numerators if it has any, else zero.
AdditiveModel model_of(const json& problem) {
  AdditiveModel model = test::named_model(problem["outputs"], problem["inputs"]);
  for (const json& s : problem["submodels"]) {
    const json numerator = s.value("numerator", json::array());
    const int terms = s.value("terms", static_cast<int>(numerator.size()));
    model.submodels.push_back(
        test::empty_submodel(model, s["integrators"], s["a"].get<std::vector<double>>(), terms));
    for (std::size_t m = 0; m < numerator.size(); ++m)
      model.submodels.back().numerator[m] = test::columns<double>(numerator[m]).transpose();
  }
  return model;
}

TEST(Certificates, StateSpace) {
  for (const json& problem : test::certificates("models")) {
    AdditiveModel model = model_of(problem);
    model.sample_rate_hz = problem["sample_rate_hz"];
    model.input_delay_s = vector_of(problem["input_delay_s"]);
    model.output_delay_s = vector_of(problem["output_delay_s"]);
    const Eigen::VectorXd hz = vector_of(problem["frequency_hz"]);
    const auto all = [](const Eigen::MatrixXcd& values) {
      std::vector<Complex> out;
      append(values, out);
      return out;
    };
    expect_digits(problem, "sampled", all(response(model, hz, HoldModel::exact)),
                  {.label = "response"});
    expect_digits(problem, "sampled", all(test::response_of(sampled_state_space(model), hz)));
    expect_digits(problem, "continuous", all(test::response_of(state_space(model), hz)));
  }
}

FrfEstimate frf_of(const json& problem, const AdditiveModel& model) {
  FrfEstimate frf;
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.frequency_hz = vector_of(problem["frequency_hz"]);
  frf.response = test::columns<Complex>(problem["response"]);
  if (problem.contains("noise_variance"))
    frf.noise_variance = test::columns<double>(problem["noise_variance"]);
  if (problem.contains("residual_covariance")) {
    frf.residual_covariance = test::columns<Complex>(problem["residual_covariance"]);
    frf.input_factor = test::columns<Complex>(problem["input_factor"]);
  }
  return frf;
}

FitOptions options_of(const json& problem) {
  FitOptions options = test::fit_options(Weighting::noise_variance);
  if (problem.contains("weights")) {
    options.weighting = Weighting::user;
    options.user_weights = test::columns<double>(problem["weights"]);
  } else if (problem.contains("weight_matrices")) {
    options.weighting = Weighting::user;
    options.user_weight_matrices = test::columns<Complex>(problem["weight_matrices"]);
  }
  if (problem.contains("delay_s")) {
    options.delay = DelayModel::estimate;
    options.delay_s = problem["delay_s"];
  }
  return options;
}

/// In the order of FitCovariance.
std::vector<double> parameters_of(const FitResult& fit) {
  std::vector<double> out;
  for (const Submodel& s : fit.model.submodels)
    out.insert(out.end(), s.denominator.begin() + 1, s.denominator.end());
  if (fit.delay == DelayModel::estimate) out.push_back(fit.model.mean_delay_s());
  for (const Submodel& s : fit.model.submodels)
    for (const Eigen::MatrixXd& B : s.numerator)
      out.insert(out.end(), B.reshaped().begin(), B.reshaped().end());
  return out;
}

/// Square roots of the certified variances of the parameters.
std::vector<double> certified_deviations(const json& problem) {
  const auto C = test::numbers<double>(problem["solution"]["covariance"]);
  const auto n = problem["solution"]["parameters"].size();
  std::vector<double> out;
  for (std::size_t i = 0; i < n; ++i) out.push_back(std::sqrt(C[i * n + i]));
  return out;
}

/// Digits at which a step no longer lowers the cost, because of its rounding. At t standard deviations from the minimum,
/// the cost is larger by the share t^2 / (2 degrees of freedom).
double digits_by_cost(const json& problem) {
  const auto parameters = test::numbers<double>(problem["solution"]["parameters"]);
  const std::vector<double> deviations = certified_deviations(problem);
  const double data = static_cast<double>(problem["response"].size()) *
                      static_cast<double>(problem["response"][0].size());
  const double degrees = data - 0.5 * static_cast<double>(parameters.size());
  const double t =
      std::sqrt(2.0 * degrees * std::pow(10.0, -problem["digits"]["cost"].get<double>()));
  double digits = 16.0;
  for (std::size_t i = 0; i < parameters.size(); ++i)
    digits = std::min(digits, -std::log10(t * deviations[i] / std::abs(parameters[i])));
  return digits;
}

void expect_covariances(const json& problem, const FitResult& fit) {
  constexpr double kAdded =
      1e-14;  // to the diagonal of normal equations, see ScaledNormalEquations
  const double limit =
      std::min(digits_by_cost(problem), -std::log10(kAdded * problem["condition"].get<double>()));
  const std::vector<double> deviations = certified_deviations(problem);
  std::vector<double> scale;
  for (const double one : deviations)
    for (const double other : deviations) scale.push_back(one * other);
  const auto C = fit.covariance.sandwich.reshaped();
  expect_digits(problem, "covariance", std::vector<double>(C.begin(), C.end()),
                {.scale = scale, .limit = limit});

  std::vector<double> frequency_hz;
  std::vector<double> damping_ratio;
  for (const Submodel& s : fit.model.submodels) {
    if (!s.is_mode()) continue;
    frequency_hz.push_back(s.natural_frequency_std_hz.value_or(0.0));
    damping_ratio.push_back(s.damping_ratio_std.value_or(0.0));
  }
  // With weight matrices, conjugate gradients end at 1e-2, and the error of a variance is the square of that.
  const double of_modes = problem.contains("weight_matrices") ? 4.0 : limit;
  expect_digits(problem, "frequency_std_hz", frequency_hz, {.limit = of_modes});
  expect_digits(problem, "damping_ratio_std", damping_ratio, {.limit = of_modes});
}

TEST(Certificates, StationaryPointsAndCovariances) {
  for (const json& problem : test::certificates("fits")) {
    const AdditiveModel start = model_of(problem);
    const FrfEstimate frf = frf_of(problem, start);
    FitOptions options = options_of(problem);
    options.gradient_tolerance = options.step_tolerance = options.deviation_tolerance = 0.0;
    FitResult fit = fit_additive_model(frf, start, options);
    ASSERT_TRUE(fit.trustworthy()) << fit.message();
    fill_covariance(frf, options, fit);
    expect_digits(problem, "cost", std::vector{fit.model.fit.cost});
    expect_digits(problem, "parameters", parameters_of(fit), {.limit = digits_by_cost(problem)});
    expect_covariances(problem, fit);
  }
}

// By default, a fit ends at 1e-4 standard deviations of noise of the size of the residual. The certified deviations
// differ from these by less than a factor of ten.
TEST(Certificates, DefaultTolerancesEndNearTheStationaryPoint) {
  for (const json& problem : test::certificates("fits")) {
    const AdditiveModel start = model_of(problem);
    const FitResult fit = fit_additive_model(frf_of(problem, start), start, options_of(problem));
    const std::vector<double> found = parameters_of(fit);
    const auto certified = test::numbers<double>(problem["solution"]["parameters"]);
    RecordProperty(problem["name"].get<std::string>() + "_parameters",
                   test::one_decimal(test::log_relative_error(found, certified)));
    EXPECT_GE(test::log_relative_error(found, certified, certified_deviations(problem)), 3.0)
        << problem["name"];
  }
}

}  // namespace stageid::test_certificates

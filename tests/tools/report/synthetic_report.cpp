#include "tests/tools/report/synthetic_report.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double delay_s = 1.63e-4;

/// Circular Gaussian noise of the variance on every number.
Eigen::MatrixXcd with_noise(const Eigen::MatrixXcd& response, const Eigen::MatrixXd& variance,
                            RandomNumbers& random) {
  Eigen::MatrixXcd out = response;
  for (Eigen::Index k = 0; k < out.cols(); ++k)
    for (Eigen::Index c = 0; c < out.rows(); ++c)
      out(c, k) += std::sqrt(variance(c, k)) * random.circular();
  return out;
}

ChannelList named(const char* prefix, Eigen::Index count, const char* unit) {
  ChannelList list;
  for (Eigen::Index i = 0; i < count; ++i) {
    list.names.push_back(fmt::format("{}{}", prefix, i + 1));
    list.units.emplace_back(unit);
  }
  return list;
}

/// Rough out-of-plane shapes: products of cosines over a plate of 2 x 2.
double shape(int mode, double x, double y) {
  return std::cos(0.5 * pi * (mode % 4) * (x + 1.0) + 0.3 * mode) *
         std::cos(0.5 * pi * (mode / 4) * (y + 1.0) + 0.2 * mode);
}

/// On an ellipse.
std::pair<double, double> position(Eigen::Index i, Eigen::Index of) {
  const double turn = 2.0 * pi * static_cast<double>(i) / static_cast<double>(of);
  return {0.9 * std::cos(turn), 0.8 * std::sin(turn)};
}

std::vector<Channel> places(const ChannelList& channels) {
  std::vector<Channel> out;
  for (const std::string& name : channels.names) {
    const auto [x, y] = position(std::ssize(out), std::ssize(channels.names));
    out.push_back({name, {}, {0.3 * x, 0.3 * y, 0.0}});
  }
  return out;
}

AdditiveModel synthetic_model(const SyntheticSize& size, std::vector<TrueMode>& truth,
                              RandomNumbers& random) {
  AdditiveModel model;
  model.inputs = named("az", size.inputs, "N");
  model.outputs = named("z", size.outputs, "m");
  model.sample_rate_hz = 10000.0;
  model.hold = HoldModel::exact;
  model.input_delay_s = Eigen::VectorXd::Constant(size.inputs, delay_s);
  model.output_delay_s = Eigen::VectorXd::Zero(size.outputs);
  Eigen::MatrixXd b(size.outputs, size.inputs);
  for (Eigen::Index o = 0; o < size.outputs; ++o)
    for (Eigen::Index i = 0; i < size.inputs; ++i) {
      const auto [xo, yo] = position(o, size.outputs);
      const auto [xi, yi] = position(i, size.inputs);
      b(o, i) = (1.0 + 1.9 * xo * xi + 1.7 * yo * yi) / 22.0;
    }
  Submodel& rigid = model.submodels.emplace_back();
  rigid.integrators = 2;
  rigid.denominator = {1.0};
  rigid.numerator = {b};

  for (int mode = 0; mode < size.modes; ++mode) {
    double f = 148.0 * std::pow(13.0, static_cast<double>(mode) / std::max(1, size.modes - 1));
    if (mode == 4 || mode == 9) f = truth.back().natural_frequency_hz * 1.008;  // close pairs
    const double zeta = 0.004 + 0.008 * random.uniform();
    truth.push_back({.natural_frequency_hz = f, .damping_ratio = zeta});
    const double omega = 2.0 * pi * f;
    for (Eigen::Index o = 0; o < size.outputs; ++o)
      for (Eigen::Index i = 0; i < size.inputs; ++i) {
        const auto [xo, yo] = position(o, size.outputs);
        const auto [xi, yi] = position(i, size.inputs);
        b(o, i) = shape(mode + 1, xo, yo) * shape(mode + 1, xi, yi) / (11.0 * omega * omega);
      }
    Submodel submodel{.integrators = 0,
                      .denominator = {1.0, 2.0 * zeta / omega, 1.0 / (omega * omega)},
                      .numerator = {b},
                      .natural_frequency_std_hz = 2e-5 * f,
                      .damping_ratio_std = 2e-3 * zeta};
    model.submodels.push_back(submodel);
  }
  return model;
}

/// The sum of the submodels and the delay, without hold.
Eigen::MatrixXcd modal_sum(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz) {
  Eigen::MatrixXcd out =
      Eigen::MatrixXcd::Zero(model.n_outputs() * model.n_inputs(), frequency_hz.size());
  for (Eigen::Index k = 0; k < frequency_hz.size(); ++k) {
    const std::complex<double> s(0.0, 2.0 * pi * frequency_hz[k]);
    for (const Submodel& submodel : model.submodels) {
      std::complex<double> denominator = 0.0;
      for (std::size_t q = submodel.denominator.size(); q-- > 0;)
        denominator = denominator * s + submodel.denominator[q];
      const std::complex<double> gain =
          std::exp(-s * delay_s) / (denominator * std::pow(s, submodel.integrators));
      out.col(k) += gain * submodel.numerator[0].reshaped();
    }
  }
  return out;
}

/// Noise that is relative near the resonances and has a floor that falls with frequency, as that of
/// a position sensor in a loop does.
Eigen::MatrixXd noise_variance(const Eigen::MatrixXcd& response, const Eigen::VectorXd& f,
                               double relative) {
  Eigen::MatrixXd variance(response.rows(), response.cols());
  for (Eigen::Index k = 0; k < f.size(); ++k)
    for (Eigen::Index c = 0; c < response.rows(); ++c) {
      const double floor = 3e-11 * (1.0 + 300.0 / f[k]);
      variance(c, k) = std::pow(relative * std::abs(response(c, k)), 2) + floor * floor;
    }
  return variance;
}

/// Random estimates with `dof` degrees of freedom: chi-square variables divided by them.
Eigen::MatrixXd estimated(const Eigen::MatrixXd& variance, int dof, RandomNumbers& random) {
  return variance.unaryExpr([&](double exact) {
    double sum = 0.0;
    for (int i = 0; i < dof; ++i) sum += std::pow(random.normal(), 2);
    return dof > 0 ? exact * sum / dof : exact;
  });
}

void add_measurement(ReportData& data, const SyntheticSize& size, RandomNumbers& random) {
  FrfEstimate frf;
  const double step = 2000.0 / static_cast<double>(size.lines);
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(size.lines, 0.5 * step, 2000.0 - 0.5 * step);
  frf.inputs = data.model->inputs;
  frf.outputs = data.model->outputs;
  data.model_response = modal_sum(*data.model, frf.frequency_hz);
  const Eigen::MatrixXd variance =
      noise_variance(data.model_response, frf.frequency_hz, size.relative_noise);
  frf.total_variance = estimated(variance, size.variance_dof, random);
  frf.noise_variance = 0.9 * frf.total_variance;
  frf.sample_rate_hz = 10000.0;
  frf.hold = Hold::zoh;
  frf.realizations = 8;
  frf.periods = 3;
  frf.experiments = static_cast<int>(size.inputs);
  frf.noise_dof = 16.0 * static_cast<double>(size.inputs);
  frf.total_dof = 7.0;
  frf.input_condition = Eigen::VectorXd::Constant(size.lines, 1.8);
  frf.excluded_channels = {"ax1", "ay1"};
  frf.excluded_power = Eigen::VectorXd{{2e-4, 1e-4}};
  frf.provenance_json = R"({"log": "run.slog", "xxh3": "5f1d2c0a99b1e3d4"})";
  data.validation_frf = frf;
  frf.response = with_noise(data.model_response, variance, random);
  data.validation_frf->response = with_noise(data.model_response, variance, random);
  data.model_variance = 0.01 * variance;
  data.frf = std::move(frf);
}

Validation compare(const ReportData& data) {
  const Eigen::MatrixXcd& g = data.validation_frf->response;
  const Eigen::ArrayXXd error = (g - data.model_response).cwiseAbs2().array();
  const Eigen::ArrayXXd relative = error / g.cwiseAbs2().array();
  Validation out;
  out.relative_rms_error = std::sqrt(relative.mean());
  out.normalized_error = std::sqrt(error.sum() / g.cwiseAbs2().sum());
  out.chi_square_per_dof = (error / data.validation_frf->total_variance.array()).mean();
  out.whitened_above_95 = 0.0507;
  out.whiteness = 0.021;
  out.whiteness_limit = 0.041;
  out.channel_error = relative.rowwise().mean().sqrt();
  return out;
}

void add_cmif(ReportData& data) {
  data.cmif_curves = cmif(*data.frf, CmifKind::accelerance);
  for (const TrueMode& mode : data.true_modes) {
    const bool close = !data.chosen_modes.empty() &&
                       mode.natural_frequency_hz < 1.01 * data.chosen_modes.back().frequency_hz;
    data.chosen_modes.push_back({mode.natural_frequency_hz * 1.0004, 0.01, close ? 2 : 1});
  }
}

void add_runs(ReportData& data, const SyntheticSize& size) {
  data.sample_rate_hz = 10000.0;
  for (int realization = 0; realization < 3; ++realization)
    for (int experiment = 0; experiment < static_cast<int>(size.inputs); ++experiment) {
      LogRun run;
      run.name = fmt::format("{:04}", realization * static_cast<int>(size.inputs) + experiment);
      run.realization = realization;
      run.experiment = experiment;
      run.samples = 160000;
      run.health = {.cycles = 160000,
                    .late = experiment == 5 ? 2u : 0u,
                    .missing = 0,
                    .marked = 0,
                    .largest_lateness_ns = 41000 + 700 * experiment,
                    .seconds = 0.11};
      // As against a wall clock: most cycles short, a few past the period of 100 us.
      for (int cycle = 0; cycle < 1000; ++cycle) {
        run.timing.execution.add(1500 + 3 * cycle);
        run.timing.lateness.add(cycle % 100 == 99 ? 150'000 : 10 + cycle % 7);
      }
      run.timing.skipped = 1;
      data.runs.push_back(run);
    }
  data.period_s = 1e-4;
  data.steps = {{"design", 0.3, ""}, {"run", 4.6, "139 times real time"}, {"frf", 1.9, "612 MB/s"},
                {"modes", 0.2, ""},  {"fit", 21.4, "34 iterations"},      {"validate", 0.4, ""}};
}

/// A controller view of two loops: circles around the critical point, one with a 95 % disc of half its distance.
void add_loops(ReportData& data) {
  nlohmann::json view = nlohmann::json::parse(
      R"({"stable": true, "largest_pole": 0.9962, "largest_pole_hz": 3.826, "encirclements": 0,
          "unstable_poles": {"closed_loop": 0, "open_loop": 0}})");
  const nlohmann::json margin = nlohmann::json::parse(
      R"({"value": 11.6, "radius_95": 0.2, "frequency_hz": 62.13, "extrapolated": true})");
  std::vector<double> f, re, im;
  for (int k = 0; k < 50; ++k) {
    f.push_back(10.0 * (k + 1));
    re.push_back(-1.0 + 0.6 * std::cos(0.12 * k));
    im.push_back(0.6 * std::sin(0.12 * k));
  }
  view["frequency_hz"] = f;
  view["determinant"] = {{"re", re}, {"im", im}, {"distance", margin}};
  for (const char* name : {"z", "Ry"})
    view["loops"].push_back({{"name", name},
                             {"re", re},
                             {"im", im},
                             {"radius_95", std::vector<double>(f.size(), 0.3)},
                             {"gain_margin_db", margin},
                             {"phase_margin_deg", nullptr}});
  data.controller_view = view.dump();
}

/// More than noise in one pair and band only, the highest band not settled; one finding of each severity.
void add_checks(ReportData& data) {
  const Eigen::Index channels = data.frf->response.rows();
  NonlinearityTest test;
  test.band_hz = Eigen::MatrixXd{{1.0, 10.0}, {10.5, 100.0}, {101.0, 2000.0}};
  test.p_value = Eigen::MatrixXd::Constant(channels, 3, 0.4);
  test.distortion = Eigen::MatrixXd::Constant(channels, 3, 2e-4);
  test.p_value(channels - 1, 1) = 3.25e-7;
  test.distortion(channels - 1, 1) = 0.0471;
  test.settled_p_value = Eigen::Vector3d(0.4, 0.5, 1e-6);
  test.p_value.col(2).setOnes();
  data.nonlinearity = test;
  data.findings = {{Severity::fault, Cause::incoherent, "az2", "clips", "312 samples at the limit",
                    "less excitation"},
                   {Severity::doubt, Cause::incoherent, "z1", "hum at 50 Hz",
                    "12 dB above its neighbours", "look at the shield"},
                   {Severity::unchecked, Cause::incoherent, "", "linearity not checked per axis",
                    "", "measure two realizations"}};
  if (data.frf->lines() > 160) data.stabilization = stabilization(*data.frf, {.delay_s = delay_s});
}

}  // namespace

ReportData synthetic_report(const SyntheticSize& size) {
  RandomNumbers random(1);
  ReportData data;
  data.title = "Wafer stage, out of plane";
  data.model = synthetic_model(size, data.true_modes, random);
  data.geometry.name = "synthetic stage";
  data.geometry.actuators = places(data.model->inputs);
  data.geometry.sensors = places(data.model->outputs);
  add_measurement(data, size, random);
  data.validation = compare(data);
  add_cmif(data);
  add_runs(data, size);
  add_loops(data);
  add_checks(data);

  // The truth differs from the model by about the stated deviations.
  for (TrueMode& mode : data.true_modes) {
    mode.natural_frequency_hz *= 1.0 + 2e-5 * 0.8 * random.normal();
    mode.damping_ratio *= 1.0 + 2e-3 * 0.8 * random.normal();
  }
  for (int i = 0; i < 35; ++i)
    data.model->cost_history.push_back(0.51 + 4e3 * std::exp(-0.55 * i) + 0.2 * std::exp(-0.1 * i));
  data.model->fit = {.cost = data.model->cost_history.back(),
                     .weighting = "total_variance",
                     .iterations = 34,
                     .status = FitStatus::gradient_small,
                     .message = {},
                     .relative_rms_error = data.validation->relative_rms_error,
                     .band_hz = {data.frf->frequency_hz[0], data.frf->frequency_hz[size.lines - 1]},
                     .seconds = 21.4};
  data.model->provenance_json = R"({"decisions": [
    "start: 15 peaks of the CMIF", "delay: 163.0 us from the slope of the phase",
    "mode added at 271.3 Hz: BIC falls by 8.1e4", "mode added at 633.0 Hz: BIC falls by 5.7e4",
    "no further mode: best candidate at 1711.9 Hz would raise BIC by 212"]})";
  data.figures = {{"error against the exact plant", "0.05 %"}};
  data.documents = {{"configs/experiment/wafer_stage_quick.yaml",
                     "realizations: 3\nperiods: 3\nband_hz: [0.25, 2000]\n"}};
  return data;
}

void add_other_day(ReportData& data) {
  ReportComparison other;
  other.title = "Tuesday";
  other.model = data.model;
  std::vector<Submodel>& submodels = other.model->submodels;
  submodels.erase(std::ranges::find_if(submodels, &Submodel::is_mode));
  for (Submodel& submodel : submodels)
    if (submodel.is_mode()) {
      submodel.denominator[1] /= 1.0 + kOtherDayShift;
      submodel.denominator[2] /= (1.0 + kOtherDayShift) * (1.0 + kOtherDayShift);
    }
  RandomNumbers random(2);
  other.model_response = 0.98 * data.model_response;
  other.response = with_noise(other.model_response, data.frf->total_variance, random);
  data.comparison = other;
}

}  // namespace stageid::test

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <memory>
#include <set>
#include <stdexcept>
#include <utility>

#include "acquisition/formats/open_log.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/confidence.hpp"
#include "frf/response/hold_compensation.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"
#include "tools/python/frf_texts.hpp"
#include "tools/python/interruptible.hpp"
#include "tools/python/numpy_arrays.hpp"
#include "tools/python/pickles.hpp"
#include "tools/python/real_arrays.hpp"
#include "tools/steps/frf_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {

namespace py = pybind11;

namespace {

using Names = std::optional<std::vector<std::string>>;
using Complexes = py::array_t<std::complex<double>, py::array::forcecast>;

const std::vector<std::string> kHolds = {"none", "zoh"};
const std::vector<std::string> kCompensations = {"none", "delay", "hold"};

ChannelList channels(Eigen::Index count, const char* prefix, const Names& names,
                     const Names& units) {
  ChannelList list;
  if (names) list.names = *names;
  if (!names)
    for (Eigen::Index c = 0; c < count; ++c)
      list.names.push_back(fmt::format("{}{}", prefix, c + 1));
  list.units = units ? *units : std::vector<std::string>(list.size());
  return list;
}

/// None: not known.
Eigen::MatrixXd variance_of(const py::object& given, const char* name) {
  if (given.is_none()) return {};
  return columns_of<double>(real_array(given, name), name);
}

FrfHandle frf_of_arrays(const py::object& frequency_hz, const Complexes& response,
                        const py::object& noise_variance, const py::object& total_variance,
                        double noise_dof, double total_dof, const Names& inputs,
                        const Names& outputs, const Names& input_units, const Names& output_units,
                        double sample_rate_hz, const std::string& hold) {
  FrfEstimate frf;
  frf.frequency_hz = real_vector(frequency_hz, "frequency_hz");
  frf.response = columns_of<std::complex<double>>(response, "response");
  frf.outputs = channels(response.shape(1), "y", outputs, output_units);
  frf.inputs = channels(response.shape(2), "u", inputs, input_units);
  frf.noise_variance = variance_of(noise_variance, "noise_variance");
  frf.total_variance = variance_of(total_variance, "total_variance");
  frf.noise_dof = noise_dof;
  frf.total_dof = total_dof;
  frf.sample_rate_hz = sample_rate_hz;
  frf.hold = pick<Hold>("hold", hold, kHolds);
  check(frf);
  return FrfHandle(std::move(frf));
}

/// Logs as they are given: a Log, the name of a file, or a list of these.
std::vector<std::shared_ptr<LogReader>> logs_of(const py::object& given) {
  const bool several = py::isinstance<py::list>(given) || py::isinstance<py::tuple>(given);
  py::list list = several ? py::list(given) : py::list();
  if (!several) list.append(given);
  std::vector<std::shared_ptr<LogReader>> logs;
  for (const py::handle& log : list) {
    if (py::isinstance<LogReader>(log)) {
      logs.push_back(log.cast<std::shared_ptr<LogReader>>());
      continue;
    }
    try {
      logs.push_back(open_log(log.cast<std::filesystem::path>()));
    } catch (const py::cast_error&) {
      throw py::type_error("logs: expected a Log, a file name, or a list of these");
    }
  }
  return logs;
}

/// As the program refuses them, but counted as they are given here.
void require_realizations(const std::vector<const LogReader*>& logs,
                          const std::vector<int>& realizations) {
  std::set<int> complete;
  for (const LogReader* log : logs)
    for (const LogRun& run : log->runs())
      if (run.complete) complete.insert(run.realization);
  for (const int realization : realizations)
    if (!complete.contains(realization))
      throw std::invalid_argument(fmt::format(
          "realizations: {} has no complete run in {}; there are {}. Realizations count from 0 in "
          "Python, as log[i]['realization'] does, and from 1 in the program",
          realization, logs.front()->path().string(), fmt::join(complete, ", ")));
}

FrfHandle frf(const py::object& given, const std::vector<std::string>& inputs,
              const std::vector<std::string>& outputs, const std::vector<int>& realizations,
              std::optional<int> transient_periods, const std::string& method,
              const std::string& covariance, const std::string& periods, int covariance_lines,
              bool health, const std::optional<std::filesystem::path>& stage, int threads) {
  FrfOptions options;
  options.inputs = inputs;
  options.outputs = outputs;
  options.realizations = realizations;
  options.transient_periods = transient_periods;
  options.method = pick<FrfMethod>("method", method, {"periodic", "lpm"});
  options.covariance = pick<CovarianceKind>("covariance", covariance, {"diagonal", "full"});
  options.periods = pick<PeriodChoice>("periods", periods, {"consistent", "unmarked"});
  options.covariance_lines = covariance_lines;
  options.threads = threads;
  const std::vector<std::shared_ptr<LogReader>> kept = logs_of(given);
  std::vector<const LogReader*> logs;
  for (const auto& log : kept) logs.push_back(log.get());
  require_realizations(logs, realizations);
  Console silent;
  silent.verbosity = Verbosity::quiet;
  return interruptible([&] {
    return FrfHandle(estimate_frf(logs, options, {health, stage.value_or("")}, silent).frf);
  });
}

FrfHandle select(const FrfHandle& of, std::optional<std::array<double, 2>> band_hz,
                 const Names& inputs, const Names& outputs) {
  FrfEstimate frf = band_hz ? select_band(of.frf, (*band_hz)[0], (*band_hz)[1]) : of.frf;
  if (inputs || outputs)
    frf = select_channels(frf, inputs.value_or(frf.inputs.names),
                          outputs.value_or(frf.outputs.names));
  return FrfHandle(std::move(frf));
}

FrfHandle compensated(const FrfHandle& of, const std::string& what, double delay_s) {
  return FrfHandle(compensate(of.frf, pick<Compensation>("what", what, kCompensations), delay_s));
}

py::object radius(const FrfHandle& of, double level, const std::string& variance) {
  const auto kind = pick<VarianceKind>("variance", variance, {"noise", "total"});
  return lines_moved<double>(confidence_radius(of.frf, level, kind), of.frf.n_outputs());
}

py::list health(const FrfEstimate& frf) {
  py::list list;
  for (const Finding& finding : health_of(frf.provenance_json)) {
    py::dict entry;
    entry["severity"] = to_string(finding.severity);
    entry["cause"] = to_string(finding.cause);
    entry["channel"] = finding.channel;
    entry["what"] = finding.what;
    entry["figure"] = finding.figure;
    entry["remedy"] = finding.remedy;
    list.append(entry);
  }
  return list;
}

/// A read-only array over a matrix of the response.
template <typename Scalar>
auto view(Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> FrfEstimate::*columns) {
  return [columns](const py::object& self) {
    const FrfEstimate& of = self.cast<const FrfHandle&>().frf;
    return lines_view<Scalar>(of.*columns, of.n_outputs(), self);
  };
}

template <typename Class>
void define_properties(Class& c) {
  const auto property = [&](const char* name, auto get, const char* doc) {
    c.def_property_readonly(
        name, [get](const FrfHandle& h) { return get(h.frf); }, doc);
  };
  c.def_property_readonly("response", view(&FrfEstimate::response), kResponseDoc);
  c.def_property_readonly("noise_variance", view(&FrfEstimate::noise_variance), kNoiseVarianceDoc);
  c.def_property_readonly("total_variance", view(&FrfEstimate::total_variance), kTotalVarianceDoc);
  c.def_property_readonly(
      "frequency_hz",
      [](const FrfHandle& h) -> const Eigen::VectorXd& { return h.frf.frequency_hz; },
      py::return_value_policy::reference_internal,
      "Frequencies in Hz, [N], increasing; a view, not copied");
  property(
      "inputs", [](const FrfEstimate& f) { return f.inputs.names; }, "Names [n_u]");
  property(
      "outputs", [](const FrfEstimate& f) { return f.outputs.names; }, "Names [n_y]");
  property(
      "input_units", [](const FrfEstimate& f) { return f.inputs.units; },
      "Units of the inputs [n_u]");
  property(
      "output_units", [](const FrfEstimate& f) { return f.outputs.units; },
      "Units of the outputs [n_y]");
  property(
      "sample_rate_hz", [](const FrfEstimate& f) { return f.sample_rate_hz; }, "Hz; 0: unknown");
  property(
      "hold", [](const FrfEstimate& f) { return kHolds[static_cast<std::size_t>(f.hold)]; },
      "'zoh' if a digital loop measured it, 'none' for a continuous-time plant");
  property(
      "compensated",
      [](const FrfEstimate& f) { return kCompensations[static_cast<std::size_t>(f.compensated)]; },
      "What the response is compensated for: 'none', 'delay' or 'hold'");
  property(
      "delay_s", [](const FrfEstimate& f) { return f.delay_s; }, "Compensated delay in s");
  property(
      "noise_dof", [](const FrfEstimate& f) { return f.noise_dof; },
      "Complex degrees of freedom of noise_variance");
  property(
      "total_dof", [](const FrfEstimate& f) { return f.total_dof; },
      "Complex degrees of freedom of total_variance");
  property(
      "correlated_lines", [](const FrfEstimate& f) { return f.correlated_lines; },
      "Zippered experiments: number of lines per independent line; else 1");
  property(
      "provenance_json", [](const FrfEstimate& f) { return f.provenance_json; },
      "Input files with their hashes, options and versions, as JSON");
  property("health", &health, kHealthDoc);
}

}  // namespace

void define_frf(py::module_& module) {
  py::class_<FrfHandle, std::shared_ptr<FrfHandle>> c(module, "Frf", kFrfDoc);
  c.def(py::init(&frf_of_arrays), py::arg("frequency_hz"), py::arg("response"), py::kw_only(),
        py::arg("noise_variance") = py::none(), py::arg("total_variance") = py::none(),
        py::arg("noise_dof") = 0.0, py::arg("total_dof") = 0.0, py::arg("inputs") = py::none(),
        py::arg("outputs") = py::none(), py::arg("input_units") = py::none(),
        py::arg("output_units") = py::none(), py::arg("sample_rate_hz") = 0.0,
        py::arg("hold") = "none", kFrfInitDoc);
  c.def(py::pickle([](const FrfHandle& frf) { return state_of(frf); }, &frf_of_state));
  define_properties(c);
  c.def("select", &select, py::kw_only(), py::arg("band_hz") = py::none(),
        py::arg("inputs") = py::none(), py::arg("outputs") = py::none(), kSelectDoc);
  c.def("compensate", &compensated, py::arg("what"), py::arg("delay_s"), kCompensateDoc);
  c.def("confidence_radius", &radius, py::arg("level") = 0.95, py::arg("variance") = "noise",
        kRadiusDoc);
  module.def(
      "frf", &frf, py::arg("logs"), py::kw_only(), py::arg("inputs") = std::vector<std::string>{},
      py::arg("outputs") = std::vector<std::string>{}, py::arg("realizations") = std::vector<int>{},
      py::arg("transient_periods") = py::none(), py::arg("method") = "periodic",
      py::arg("covariance") = "diagonal", py::arg("periods") = "consistent",
      py::arg("covariance_lines") = 1, py::arg("health") = true, py::arg("stage") = py::none(),
      py::arg("threads") = 0, kEstimateDoc);
  module.def("read_frf", &read_frf_handle, py::arg("file"), kReadFrfDoc);
  module.def(
      "write_frf",
      [](const std::filesystem::path& file, const FrfHandle& h) {
        require_frf_ending(file);
        write_frf(file, h.frf);
      },
      py::arg("file"), py::arg("frf"), kWriteFrfDoc);
}

}  // namespace stageid

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <memory>
#include <utility>
#include <variant>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/formats/open_log.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/confidence.hpp"
#include "frf/response/hold_compensation.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/python/arguments.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/frf_handle.hpp"
#include "tools/python/interruptible.hpp"
#include "tools/python/pickles.hpp"
#include "tools/python/results.hpp"
#include "tools/steps/frf_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {

namespace {

using Complexes = py::array_t<std::complex<double>, py::array::forcecast>;

/// None: not known.
Eigen::MatrixXd variance_of(const py::object& given, const char* name) {
  if (given.is_none()) return {};
  return columns_of<double>(real_array(given, name), name);
}

FrfHandle frf_of_arrays(const py::object& frequency_hz, const Complexes& response,
                        const py::object& noise_variance, const py::object& total_variance,
                        std::optional<double> noise_dof, std::optional<double> total_dof,
                        const Names& inputs, const Names& outputs,
                        const std::optional<Units>& input_units,
                        const std::optional<Units>& output_units,
                        std::optional<double> sample_rate_hz, const std::string& hold) {
  FrfEstimate frf;
  frf.frequency_hz = real_vector(frequency_hz, "frequency_hz");
  frf.response = columns_of<std::complex<double>>(response, "response");
  frf.outputs = channels("outputs", response.shape(1), "y", outputs, output_units);
  frf.inputs = channels("inputs", response.shape(2), "u", inputs, input_units);
  frf.noise_variance = variance_of(noise_variance, "noise_variance");
  frf.total_variance = variance_of(total_variance, "total_variance");
  frf.noise_dof = noise_dof.value_or(0.0);
  frf.total_dof = total_dof.value_or(0.0);
  frf.sample_rate_hz = sample_rate_hz.value_or(0.0);
  frf.hold = pick<Hold>("hold", hold);
  check(frf);
  return FrfHandle{std::move(frf)};
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

/// One, several, or None for the default.
template <typename T>
using Choice = std::optional<std::variant<T, std::vector<T>>>;

/// Empty: the default. An empty list is refused: it would mean "all", too.
template <typename T>
std::vector<T> chosen(const char* what, const Choice<T>& given) {
  if (!given) return {};
  if (const T* one = std::get_if<T>(&*given)) return {*one};
  const auto& several = std::get<std::vector<T>>(*given);
  if (several.empty())
    fail_request("{}: empty list. Give at least one, or None for the default", what);
  return several;
}

FrfHandle frf(const py::object& given, const Choice<std::string>& inputs,
              const Choice<std::string>& outputs, const Choice<int>& realizations,
              std::optional<int> transient_periods, const std::string& method,
              const std::string& covariance, const std::string& periods, int covariance_lines,
              bool health, const std::optional<std::filesystem::path>& stage,
              std::optional<int> threads) {
  FrfOptions options;
  options.inputs = chosen("inputs", inputs);
  options.outputs = chosen("outputs", outputs);
  options.realizations = chosen("realizations", realizations);
  for (int& realization : options.realizations) --realization;  // users count from 1
  options.transient_periods = transient_periods;
  options.method = pick<FrfMethod>("method", method);
  options.covariance = pick<CovarianceKind>("covariance", covariance);
  options.periods = pick<PeriodChoice>("periods", periods);
  options.covariance_lines = covariance_lines;
  options.threads = threads.value_or(0);
  const std::vector<std::shared_ptr<LogReader>> kept = logs_of(given);
  std::vector<const LogReader*> logs;
  for (const auto& log : kept) logs.push_back(log.get());
  Console silent;
  silent.verbosity = Verbosity::quiet;
  return interruptible([&] {
    return FrfHandle{estimate_frf(logs, options, {health, stage.value_or("")}, silent).frf};
  });
}

FrfHandle select(const FrfHandle& of, std::optional<std::array<double, 2>> band_hz,
                 const Choice<std::string>& inputs, const Choice<std::string>& outputs) {
  FrfEstimate frf = band_hz ? select_band(of.frf, (*band_hz)[0], (*band_hz)[1]) : of.frf;
  if (inputs || outputs)
    frf = select_channels(frf, inputs ? chosen("inputs", inputs) : frf.inputs.names,
                          outputs ? chosen("outputs", outputs) : frf.outputs.names);
  return FrfHandle{std::move(frf)};
}

FrfHandle compensated(const FrfHandle& of, const std::string& what, double delay_s) {
  return FrfHandle{compensate(of.frf, pick<Compensation>("what", what), delay_s)};
}

py::object radius(const FrfHandle& of, double level, const std::string& variance) {
  const auto kind = pick<VarianceKind>("variance", variance);
  return lines_moved<double>(confidence_radius(of.frf, level, kind), of.frf.n_outputs());
}

py::list health(const FrfEstimate& frf) {
  py::list list;
  for (const Finding& f : health_of(frf.provenance_json))
    list.append(result("Finding", "severity"_a = to_string(f.severity),
                       "cause"_a = to_string(f.cause), "channel"_a = unless_empty(f.channel),
                       "what"_a = f.what, "figure"_a = unless_empty(f.figure),
                       "remedy"_a = unless_empty(f.remedy)));
  return list;
}

void write(const std::filesystem::path& file, const FrfHandle& of) {
  require_frf_ending(file);
  write_frf(file, of.frf);
}

/// A read-only array over a matrix of the response.
template <typename Scalar>
auto view(Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> ChannelData::*columns) {
  return [columns](const py::object& self) {
    const FrfEstimate& of = self.cast<const FrfHandle&>().frf;
    return lines_view<Scalar>(of.*columns, of.n_outputs(), self);
  };
}

const char* of_frf(const char* name) { return docstring(std::string("Frf.") + name); }

template <typename Class>
void define_frf_properties(Class& c) {
  const auto array = [&](const char* name, auto get) {
    c.def_property_readonly(name, get, of_frf(name));
  };
  array("response", view(&FrfEstimate::response));
  array("noise_variance", view(&FrfEstimate::noise_variance));
  array("total_variance", view(&FrfEstimate::total_variance));
  c.def_property_readonly(
      "frequency_hz",
      [](const FrfHandle& h) -> const Eigen::VectorXd& { return h.frf.frequency_hz; },
      py::return_value_policy::reference_internal, of_frf("frequency_hz"));

  const auto property = [&](const char* name, auto get) {
    c.def_property_readonly(
        name, [get](const FrfHandle& h) { return get(h.frf); }, of_frf(name));
  };
  using F = FrfEstimate;
  property("inputs", [](const F& f) { return f.inputs.names; });
  property("outputs", [](const F& f) { return f.outputs.names; });
  property("input_units", [](const F& f) { return units_of(f.inputs); });
  property("output_units", [](const F& f) { return units_of(f.outputs); });
  property("sample_rate_hz", [](const F& f) { return unless_zero(f.sample_rate_hz); });
  property("hold", [](const F& f) { return to_string(f.hold); });
  const auto if_compensated = [](const F& f, auto value) {
    return f.compensated == Compensation::none ? py::none() : py::cast(value);
  };
  property("compensated", [=](const F& f) { return if_compensated(f, to_string(f.compensated)); });
  property("delay_s", [=](const F& f) { return if_compensated(f, f.delay_s); });
  property("noise_dof", [](const F& f) { return unless_zero(f.noise_dof); });
  property("total_dof", [](const F& f) { return unless_zero(f.total_dof); });
  property("correlated_lines", [](const F& f) { return f.correlated_lines; });
  property("provenance_json", [](const F& f) { return f.provenance_json; });
  property("health", &health);
}

}  // namespace

FrfHandle read_frf_handle(const std::filesystem::path& file) {
  return {read_frf(file), file.filename().string(), fingerprint_of_file(file)};
}

void define_frf(py::module_& module) {
  py::class_<FrfHandle, std::shared_ptr<FrfHandle>> c(module, "Frf", docstring("Frf"));
  c.def(py::init(&frf_of_arrays), "frequency_hz"_a, "response"_a, py::kw_only(),
        "noise_variance"_a = py::none(), "total_variance"_a = py::none(),
        "noise_dof"_a = py::none(), "total_dof"_a = py::none(), "inputs"_a = py::none(),
        "outputs"_a = py::none(), "input_units"_a = py::none(), "output_units"_a = py::none(),
        "sample_rate_hz"_a = py::none(), "hold"_a = "none", of_frf("__init__"));
  c.def(py::pickle([](const FrfHandle& frf) { return state_of(frf); }, &frf_of_state));
  define_frf_properties(c);
  c.def("select", &select, py::kw_only(), "band_hz"_a = py::none(), "inputs"_a = py::none(),
        "outputs"_a = py::none(), of_frf("select"));
  c.def("compensate", &compensated, "what"_a, "delay_s"_a, of_frf("compensate"));
  c.def("confidence_radius", &radius, "level"_a = 0.95, "variance"_a = "noise",
        of_frf("confidence_radius"));
  module.def("frf", &frf, "logs"_a, py::kw_only(), "inputs"_a = py::none(),
             "outputs"_a = py::none(), "realizations"_a = py::none(),
             "transient_periods"_a = py::none(), "method"_a = "periodic",
             "covariance"_a = "diagonal", "periods"_a = "consistent", "covariance_lines"_a = 1,
             "health"_a = true, "stage"_a = py::none(), "threads"_a = py::none(), docstring("frf"));
  module.def("read_frf", &read_frf_handle, "file"_a, docstring("read_frf"));
  module.def("write_frf", &write, "file"_a, "frf"_a, docstring("write_frf"));
}

}  // namespace stageid

#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <map>
#include <set>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/formats/open_log.hpp"
#include "tools/python/arguments.hpp"
#include "tools/python/array_log.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/pickles.hpp"
#include "tools/python/results.hpp"
#include "tools/python/simulate.hpp"

namespace stageid {
namespace {

std::shared_ptr<LogReader> log_of_arrays(const py::object& r, const py::object& u,
                                         const py::object& y, double sample_rate_hz,
                                         int transient_periods, const Names& excitation,
                                         const Names& actuators, const Names& sensors,
                                         const std::optional<Units>& actuator_units,
                                         const std::optional<Units>& sensor_units,
                                         const py::object& marked) {
  ExperimentArrays arrays = experiment_arrays(r, u, y, marked);
  const auto last_axis = [](const py::array& array) {
    return array.ndim() == 4 ? array.shape(3) : 0;
  };
  LogInfo info;
  info.sample_rate_hz = sample_rate_hz;
  const RealArray& period = arrays.excitation;
  info.period_samples = period.ndim() == 4 ? static_cast<int>(period.shape(2)) : 0;
  info.transient_periods = transient_periods;
  info.actuators =
      channels("actuators", last_axis(arrays.actuators), "u", actuators, actuator_units);
  info.sensors = channels("sensors", last_axis(arrays.sensors), "y", sensors, sensor_units);
  const bool at_actuators = !excitation && last_axis(period) == last_axis(arrays.actuators);
  info.excitation = at_actuators ? info.actuators
                                 : channels("excitation", last_axis(period), "r", excitation, {});
  return std::make_shared<ArrayLog>("arrays", std::move(info), std::move(arrays));
}

py::object run_at(const LogReader& log, py::ssize_t index) {
  const auto count = static_cast<py::ssize_t>(log.runs().size());
  if (index < -count || index >= count)
    throw py::index_error(fmt::format("run {} is out of range; the log has {} runs", index, count));
  const auto run = static_cast<std::size_t>(index < 0 ? index + count : index);
  const LogRun& about = log.runs()[run];
  LogSamples samples;
  log.read(run, 0, about.samples, samples);
  return result("Run", "realization"_a = about.realization + 1,
                "experiment"_a = about.experiment + 1, "complete"_a = about.complete,
                "excitation"_a = log.excitation(run), "actuators"_a = std::move(samples.actuators),
                "sensors"_a = std::move(samples.sensors),
                "marked"_a = py::cast(std::move(samples.marked)).attr("astype")("bool"));
}

std::set<int> complete_realizations(const LogReader& log) {
  std::set<int> realizations;
  for (const LogRun& run : log.runs())
    if (run.complete) realizations.insert(run.realization + 1);
  return realizations;
}

/// Where each run of a full experiment stands: [realization][experiment] without a gap.
std::vector<std::size_t> full_experiment(const LogReader& log, py::ssize_t& M, py::ssize_t& E) {
  std::map<std::pair<int, int>, std::size_t> at;
  M = E = 0;
  for (std::size_t i = 0; i < log.runs().size(); ++i) {
    const LogRun& run = log.runs()[i];
    if (!run.complete) continue;
    at[{run.realization, run.experiment}] = i;
    M = std::max(M, py::ssize_t{run.realization} + 1);
    E = std::max(E, py::ssize_t{run.experiment} + 1);
  }
  std::vector<std::size_t> order;
  for (const auto& [id, index] : at) order.push_back(index);
  const bool full = std::ssize(at) == M * E && M > 0;
  const bool equal = full && std::ranges::all_of(order, [&](std::size_t i) {
                       return log.runs()[i].samples == log.runs()[order.front()].samples;
                     });
  if (!equal)
    fail_request(
        "{}: the complete runs are not {} of {} with equal lengths; read them one by one with "
        "log[i]",
        log.path().string(), counted(M, "realization"), counted(E, "experiment"));
  return order;
}

py::object read_arrays(const LogReader& log) {
  py::ssize_t M = 0, E = 0;
  const std::vector<std::size_t> order = full_experiment(log, M, E);
  const LogInfo& info = log.info();
  const auto S = static_cast<py::ssize_t>(log.runs()[order.front()].samples);
  const auto width = [](const ChannelList& list) { return std::ssize(list); };
  py::array_t<double> r({M, E, py::ssize_t{info.period_samples}, width(info.excitation)});
  py::array_t<double> u({M, E, S, width(info.actuators)});
  py::array_t<double> y({M, E, S, width(info.sensors)});
  using Rows = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  LogSamples samples;
  for (std::size_t run = 0; run < order.size(); ++run) {
    log.read(order[run], 0, static_cast<std::uint64_t>(S), samples);
    const auto m = static_cast<py::ssize_t>(run) / E, e = static_cast<py::ssize_t>(run) % E;
    const auto put = [&](py::array_t<double>& array, const Eigen::MatrixXd& columns) {
      Rows(array.mutable_data(m, e, 0, 0), columns.rows(), columns.cols()) = columns;
    };
    put(r, log.excitation(order[run]));
    put(u, samples.actuators);
    put(y, samples.sensors);
  }
  return result("LogArrays", r, u, y);
}

py::object arrays(const LogReader& log) {
  const auto* in_memory = dynamic_cast<const ArrayLog*>(&log);
  if (in_memory == nullptr) return read_arrays(log);
  const ExperimentArrays& a = in_memory->arrays();
  return result("LogArrays", a.excitation, a.actuators, a.sensors);
}

std::shared_ptr<LogReader> read_log(const std::filesystem::path& file) { return open_log(file); }

const char* of_log(const char* name) { return docstring(std::string("Log.") + name); }

template <typename Class>
void define_log_properties(Class& log) {
  log.def_property_readonly(
      "realizations",
      [](const LogReader& l) {
        const std::set<int> found = complete_realizations(l);
        return std::vector<int>(found.begin(), found.end());
      },
      of_log("realizations"));
  const auto property = [&](const char* name, auto get) {
    log.def_property_readonly(
        name, [get](const LogReader& l) { return get(l.info()); }, of_log(name));
  };
  using I = LogInfo;
  property("sample_rate_hz", [](const I& i) { return i.sample_rate_hz; });
  property("period_samples", [](const I& i) { return i.period_samples; });
  property("transient_periods", [](const I& i) { return i.transient_periods; });
  property("excitation", [](const I& i) { return i.excitation.names; });
  property("actuators", [](const I& i) { return i.actuators.names; });
  property("sensors", [](const I& i) { return i.sensors.names; });
  property("actuator_units", [](const I& i) { return units_of(i.actuators); });
  property("sensor_units", [](const I& i) { return units_of(i.sensors); });
}

}  // namespace

void define_logs(py::module_& module) {
  py::class_<LogReader, std::shared_ptr<LogReader>> log(module, "Log", docstring("Log"));
  log.def(py::init(&log_of_arrays), "r"_a, "u"_a, "y"_a, py::kw_only(), "sample_rate_hz"_a,
          "transient_periods"_a = 0, "excitation"_a = py::none(), "actuators"_a = py::none(),
          "sensors"_a = py::none(), "actuator_units"_a = py::none(), "sensor_units"_a = py::none(),
          "marked"_a = py::none(), of_log("__init__"));
  log.def(py::pickle([](const LogReader& l) { return state_of(l); }, &log_of_state));
  define_log_properties(log);
  log.def(
      "__len__", [](const LogReader& l) { return l.runs().size(); }, of_log("__len__"));
  log.def(
      "__iter__",
      [](const py::object& self) {
        return py::reinterpret_steal<py::object>(PySeqIter_New(self.ptr()));
      },
      of_log("__iter__"));
  log.def("__getitem__", &run_at, "run"_a, of_log("__getitem__"));
  log.def("arrays", &arrays, of_log("arrays"));
  module.def("read_log", &read_log, "file"_a, docstring("read_log"));
  module.def("simulate", &simulate, "config"_a, docstring("simulate"));
}

}  // namespace stageid

#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <bit>
#include <map>
#include <stdexcept>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/slog/slog_format.hpp"
#include "tools/python/array_log.hpp"
#include "tools/python/bindings.hpp"
#include "tools/python/interruptible.hpp"
#include "tools/python/log_texts.hpp"
#include "tools/python/pickles.hpp"
#include "tools/python/real_arrays.hpp"
#include "tools/python/simulate.hpp"

namespace stageid {
namespace {

namespace py = pybind11;

using Names = std::optional<std::vector<std::string>>;

/// Names and units of a group of channels: prefix1, prefix2, ... unless given.
ChannelList channels(const char* group, py::ssize_t count, const char* prefix, const Names& names,
                     const Names& units) {
  ChannelList list;
  if (names) list.names = *names;
  if (!names)
    for (py::ssize_t c = 0; c < count; ++c)
      list.names.push_back(fmt::format("{}{}", prefix, c + 1));
  list.units = units ? *units : std::vector<std::string>(list.size());
  if (list.units.size() != list.size())
    throw std::invalid_argument(fmt::format("{}: {} for {}; give one per channel", group,
                                            counted(list.units.size(), "unit"),
                                            counted(list.size(), "channel")));
  return list;
}

/// The arguments r, u, y and marked (None: nothing is marked) of a log.
ExperimentArrays given_arrays(const py::object& r, const py::object& u, const py::object& y,
                              const py::object& marked) {
  ExperimentArrays arrays{real_array(r, "r"), real_array(u, "u"), real_array(y, "y"), {}};
  if (!marked.is_none()) arrays.marked = flag_array(marked, "marked");
  return arrays;
}

std::shared_ptr<LogReader> log_of_arrays(const py::object& r, const py::object& u,
                                         const py::object& y, double sample_rate_hz,
                                         int transient_periods, const Names& excitation,
                                         const Names& actuators, const Names& sensors,
                                         const Names& actuator_units, const Names& sensor_units,
                                         const py::object& marked) {
  ExperimentArrays arrays = given_arrays(r, u, y, marked);
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

/// Bytes from an element of each axis of a C-ordered array [M x E x S x words] to the next.
std::vector<py::ssize_t> c_strides(py::ssize_t E, py::ssize_t S, py::ssize_t words) {
  constexpr py::ssize_t kWord = sizeof(double);
  return {E * S * words * kWord, S * words * kWord, words * kWord, kWord};
}

/// The rows that a simulation left, as arrays over the same memory.
ExperimentArrays arrays_of(SimulatedExperiment experiment) {
  const py::ssize_t M = experiment.realizations, E = experiment.experiments;
  const auto S = static_cast<py::ssize_t>(experiment.samples);
  RunMemory* memory = experiment.runs.get();
  const auto n_u = static_cast<py::ssize_t>(memory->info().actuators.size());
  const auto n_y = static_cast<py::ssize_t>(memory->info().sensors.size());
  const auto n_r = static_cast<py::ssize_t>(memory->info().excitation.size());
  const py::ssize_t words = n_u + n_y + 1;
  const py::capsule owner(experiment.runs.release(),
                          [](void* p) { delete static_cast<RunMemory*>(p); });

  ExperimentArrays arrays;
  const std::vector<double>& rows = memory->rows();
  arrays.actuators =
      ExperimentArrays::Reals({M, E, S, n_u}, c_strides(E, S, words), rows.data(), owner);
  arrays.sensors =
      ExperimentArrays::Reals({M, E, S, n_y}, c_strides(E, S, words), rows.data() + n_u, owner);
  arrays.marked = ExperimentArrays::Flags({M, E, S});
  std::uint8_t* marked = arrays.marked->mutable_data();
  for (py::ssize_t n = 0; n < M * E * S; ++n) {
    const double word = rows[static_cast<std::size_t>(n * words + words - 1)];
    marked[n] = unpack_status(std::bit_cast<std::uint64_t>(word)).marked ? 1 : 0;
  }
  const auto P = static_cast<py::ssize_t>(memory->info().period_samples);
  arrays.excitation = ExperimentArrays::Reals({M, E, P, n_r}, memory->excitation().data(), owner);
  return arrays;
}

std::shared_ptr<LogReader> simulate(const std::filesystem::path& config) {
  SimulatedExperiment experiment = interruptible([&] { return simulate_experiment(config); });
  LogInfo info = experiment.runs->info();
  std::filesystem::path name = experiment.name;
  return std::make_shared<ArrayLog>(std::move(name), std::move(info),
                                    arrays_of(std::move(experiment)));
}

py::dict run_at(const LogReader& log, py::ssize_t index) {
  const auto count = static_cast<py::ssize_t>(log.runs().size());
  if (index < -count || index >= count)
    throw py::index_error(fmt::format("run {} is out of range; the log has {} runs", index, count));
  const auto run = static_cast<std::size_t>(index < 0 ? index + count : index);
  const LogRun& about = log.runs()[run];
  LogSamples samples;
  log.read(run, 0, about.samples, samples);
  py::dict out;
  out["realization"] = about.realization;
  out["experiment"] = about.experiment;
  out["complete"] = about.complete;
  out["excitation"] = log.excitation(run);
  out["actuators"] = std::move(samples.actuators);
  out["sensors"] = std::move(samples.sensors);
  out["marked"] = std::move(samples.marked);
  return out;
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
  const bool full = static_cast<py::ssize_t>(at.size()) == M * E && M > 0;
  const bool equal = full && std::all_of(order.begin(), order.end(), [&](std::size_t i) {
                       return log.runs()[i].samples == log.runs()[order.front()].samples;
                     });
  if (!equal)
    throw std::invalid_argument(
        fmt::format("{}: the complete runs are not {} of {} with equal lengths; read them one by "
                    "one with log[i]",
                    log.path().string(), counted(M, "realization"), counted(E, "experiment")));
  return order;
}

py::tuple read_arrays(const LogReader& log) {
  py::ssize_t M = 0, E = 0;
  const std::vector<std::size_t> order = full_experiment(log, M, E);
  const LogInfo& info = log.info();
  const auto S = static_cast<py::ssize_t>(log.runs()[order.front()].samples);
  const auto width = [](const ChannelList& list) { return static_cast<py::ssize_t>(list.size()); };
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
  return py::make_tuple(r, u, y);
}

py::tuple arrays(const LogReader& log) {
  const auto* in_memory = dynamic_cast<const ArrayLog*>(&log);
  if (in_memory == nullptr) return read_arrays(log);
  const ExperimentArrays& a = in_memory->arrays();
  return py::make_tuple(a.excitation, a.actuators, a.sensors);
}

std::shared_ptr<LogReader> read_log(const std::filesystem::path& file) { return open_log(file); }

template <typename Class>
void define_properties(Class& log) {
  const auto property = [&](const char* name, auto get, const char* doc) {
    log.def_property_readonly(
        name, [get](const LogReader& l) { return get(l.info()); }, doc);
  };
  property(
      "sample_rate_hz", [](const LogInfo& i) { return i.sample_rate_hz; },
      "Sample rate of the loop in Hz");
  property(
      "period_samples", [](const LogInfo& i) { return i.period_samples; },
      "Samples per period of the excitation");
  property(
      "transient_periods", [](const LogInfo& i) { return i.transient_periods; },
      "Periods at the beginning of every run that an estimate discards");
  property(
      "excitation", [](const LogInfo& i) { return i.excitation.names; },
      "Names of the excited channels [n_r]");
  property(
      "actuators", [](const LogInfo& i) { return i.actuators.names; },
      "Names of the actuators [n_u]");
  property(
      "sensors", [](const LogInfo& i) { return i.sensors.names; }, "Names of the sensors [n_y]");
  property(
      "actuator_units", [](const LogInfo& i) { return i.actuators.units; },
      "Units of the actuators [n_u]");
  property(
      "sensor_units", [](const LogInfo& i) { return i.sensors.units; },
      "Units of the sensors [n_y]");
}

}  // namespace

void define_logs(py::module_& module) {
  py::class_<LogReader, std::shared_ptr<LogReader>> log(module, "Log", kLogDoc);
  log.def(py::init(&log_of_arrays), py::arg("r"), py::arg("u"), py::arg("y"), py::kw_only(),
          py::arg("sample_rate_hz"), py::arg("transient_periods") = 0,
          py::arg("excitation") = py::none(), py::arg("actuators") = py::none(),
          py::arg("sensors") = py::none(), py::arg("actuator_units") = py::none(),
          py::arg("sensor_units") = py::none(), py::arg("marked") = py::none(), kLogInitDoc);
  log.def(py::pickle([](const LogReader& of) { return state_of(of); }, &log_of_state));
  define_properties(log);
  log.def(
      "__len__", [](const LogReader& l) { return l.runs().size(); },
      "Number of runs, including incomplete ones");
  log.def(
      "__iter__",
      [](const py::object& self) {
        return py::reinterpret_steal<py::object>(PySeqIter_New(self.ptr()));
      },
      "Iterates over the runs");
  log.def("__getitem__", &run_at, py::arg("run"), kRunDoc);
  log.def("arrays", &arrays, kArraysDoc);
  module.def("read_log", &read_log, py::arg("file"), kReadLogDoc);
  module.def("simulate", &simulate, py::arg("config"), kSimulateDoc);
}

}  // namespace stageid

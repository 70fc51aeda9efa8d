#include "tools/python/array_log.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/record/log_checks.hpp"
#include "acquisition/record/row_transpose.hpp"

namespace stageid {
namespace {

constexpr py::ssize_t kWord = sizeof(double);

/// True if a sample's channels are neighbours, samples are whole words apart, and reading needs no care
/// for alignment.
bool rows_stand_together(const RealArray& array) {
  const bool aligned = reinterpret_cast<std::uintptr_t>(array.data()) % alignof(double) == 0 &&
                       array.strides(0) % kWord == 0 && array.strides(1) % kWord == 0;
  return aligned && array.strides(2) >= 0 && array.strides(2) % kWord == 0 &&
         (array.strides(3) == kWord || array.shape(3) == 1);
}

Eigen::MatrixXd period_of(const RealArray& excitation, py::ssize_t realization,
                          py::ssize_t experiment) {
  const auto in = excitation.unchecked<4>();  // needs no lock: shape and address only
  Eigen::MatrixXd period(in.shape(2), in.shape(3));
  for (Eigen::Index n = 0; n < period.rows(); ++n)
    for (Eigen::Index c = 0; c < period.cols(); ++c)
      period(n, c) = in(realization, experiment, n, c);
  return period;
}

RealArray with_rows_together(RealArray array) {
  if (rows_stand_together(array)) return array;
  return py::array_t<double, py::array::c_style | py::array::forcecast>(array);
}

void require(bool fits, const char* name, const py::array& array, const std::string& right) {
  if (fits) return;
  fail_request("{}: has the shape [{}]; {}", name,
               fmt::join(array.shape(), array.shape() + array.ndim(), " x "), right);
}

void require_axes(const char* name, const py::array& array, py::ssize_t axes, const char* right) {
  require(array.ndim() == axes, name, array, right);
}

}  // namespace

ExperimentArrays experiment_arrays(const py::object& r, const py::object& u, const py::object& y,
                                   const py::object& marked) {
  ExperimentArrays arrays{real_array(r, "r"), real_array(u, "u"), real_array(y, "y"), {}};
  if (!marked.is_none()) arrays.marked = flag_array(marked, "marked");
  return arrays;
}

ArrayLog::ArrayLog(std::filesystem::path name, LogInfo info, ExperimentArrays arrays)
    : name_(std::move(name)), info_(std::move(info)), arrays_(std::move(arrays)) {
  check_shapes();
  check_log_info(info_);
  arrays_.actuators = with_rows_together(std::move(arrays_.actuators));
  arrays_.sensors = with_rows_together(std::move(arrays_.sensors));
  locate_runs();
  check_runs(name_, info_, runs_);
}

void ArrayLog::check_shapes() const {
  const ExperimentArrays& a = arrays_;
  constexpr const char* kAxes = "expected [realizations x experiments x samples x channels]";
  require_axes("excitation", a.excitation, 4, kAxes);
  require_axes("actuators", a.actuators, 4, kAxes);
  require_axes("sensors", a.sensors, 4, kAxes);
  require(a.sensors.shape(0) > 0 && a.sensors.shape(1) > 0, "sensors", a.sensors,
          "a log needs at least one realization and one experiment");
  const auto same_runs = [&](const char* name, const py::array& array) {
    require(array.shape(0) == a.sensors.shape(0) && array.shape(1) == a.sensors.shape(1), name,
            array,
            fmt::format("sensors have {} of {}", counted(a.sensors.shape(0), "realization"),
                        counted(a.sensors.shape(1), "experiment")));
  };
  same_runs("excitation", a.excitation);
  same_runs("actuators", a.actuators);
  const auto same_samples = [&](const char* name, const py::array& array) {
    require(array.shape(2) == a.sensors.shape(2), name, array,
            fmt::format("sensors have {}", counted(a.sensors.shape(2), "sample")));
  };
  same_samples("actuators", a.actuators);
  const auto channels = [](const char* name, const py::array& array, const ChannelList& list) {
    require(array.shape(3) == std::ssize(list), name, array,
            fmt::format("expected {} for its last axis", counted(list.size(), "name")));
  };
  channels("excitation", a.excitation, info_.excitation);
  channels("actuators", a.actuators, info_.actuators);
  channels("sensors", a.sensors, info_.sensors);
  require(a.excitation.shape(2) == info_.period_samples, "excitation", a.excitation,
          fmt::format("expected one period of {} samples", info_.period_samples));
  if (!a.marked) return;
  require_axes("marked", *a.marked, 3, "expected [realizations x experiments x samples]");
  same_runs("marked", *a.marked);
  same_samples("marked", *a.marked);
}

ArrayLog::Rows ArrayLog::rows_of(const RealArray& array, py::ssize_t realization,
                                 py::ssize_t experiment) {
  if (array.size() == 0) return {};
  return {array.data(realization, experiment, 0, 0),
          static_cast<std::size_t>(array.strides(2) / kWord)};
}

void ArrayLog::locate_runs() {
  const ExperimentArrays& a = arrays_;
  for (py::ssize_t m = 0; m < a.sensors.shape(0); ++m) {
    for (py::ssize_t e = 0; e < a.sensors.shape(1); ++e) {
      LogRun run;
      run.name = fmt::format("{:04}", runs_.size());
      run.realization = static_cast<int>(m);
      run.experiment = static_cast<int>(e);
      run.samples = static_cast<std::uint64_t>(a.sensors.shape(2));
      run.health.cycles = run.samples;
      runs_.push_back(std::move(run));
      actuators_.push_back(rows_of(a.actuators, m, e));
      sensors_.push_back(rows_of(a.sensors, m, e));
      if (!period_of(a.excitation, m, e).allFinite())
        fail_request(
            "excitation: realization {}, experiment {} (counted from 1) is not finite; remove NaN "
            "and infinity",
            m + 1, e + 1);
      auto& marked = marked_.emplace_back();
      marked.setZero(a.sensors.shape(2));
      if (!a.marked) continue;
      const auto given = a.marked->unchecked<3>();
      for (Eigen::Index n = 0; n < marked.size(); ++n) marked[n] = given(m, e, n);
    }
  }
}

Eigen::MatrixXd ArrayLog::excitation(std::size_t run) const {
  check_run_index(name_, runs_, run);
  return period_of(arrays_.excitation, runs_[run].realization, runs_[run].experiment);
}

void ArrayLog::read(std::size_t run, std::uint64_t first, std::uint64_t count,
                    LogSamples& out) const {
  check_run_index(name_, runs_, run);
  check_row_range(name_, runs_[run], first, count);
  resize_samples(info_, count, out);
  const auto copy = [&](const Rows& rows, Eigen::MatrixXd& columns) {
    return transpose_rows(rows.first + first * rows.words, rows.words, count,
                          static_cast<std::size_t>(columns.cols()), columns.data(), count);
  };
  const bool actuators_finite = copy(actuators_[run], out.actuators);
  const bool sensors_finite = copy(sensors_[run], out.sensors);
  out.marked = marked_[run].segment(first, count);
  if (!actuators_finite || !sensors_finite)
    throw_not_finite(name_, info_, runs_[run], first, out, 0, out.marked.size());
}

}  // namespace stageid

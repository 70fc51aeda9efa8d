#include "tools/python/pickles.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>

#include "acquisition/files/output_file.hpp"
#include "acquisition/formats/open_log.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/python/array_log.hpp"

namespace stageid {
namespace {

std::filesystem::path scratch_name(const char* name) {
  return std::filesystem::temp_directory_path() / name;
}

py::bytes content_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return py::bytes(std::string(std::istreambuf_iterator<char>(stream), {}));
}

void fill(const std::filesystem::path& file, const py::bytes& content) {
  std::ofstream(file, std::ios::binary) << std::string(content);
}

py::tuple channels_state(const ChannelList& channels) {
  return py::make_tuple(channels.names, channels.units);
}

ChannelList channels_of(const py::handle& state) {
  const auto [names, units] =
      state.cast<std::pair<std::vector<std::string>, std::vector<std::string>>>();
  return {names, units};
}

py::list ranks_state(const std::vector<ResidueRankTest>& tests) {
  py::list list;
  for (const ResidueRankTest& t : tests)
    list.append(py::make_tuple(t.submodel, t.natural_frequency_hz, t.rank, t.chi_square,
                               t.parameters, t.probability));
  return list;
}

std::vector<ResidueRankTest> ranks_of(const py::handle& state) {
  std::vector<ResidueRankTest> tests;
  for (const auto& [submodel, frequency_hz, rank, chi_square, parameters, probability] :
       state.cast<std::vector<std::tuple<std::size_t, double, int, double, int, double>>>())
    tests.push_back({submodel, frequency_hz, rank, chi_square, parameters, probability});
  return tests;
}

}  // namespace

py::tuple state_of(const FrfHandle& frf) {
  const OutputFile scratch(scratch_name("stageid.h5"));
  write_frf(scratch.path(), frf.frf);
  return py::make_tuple(content_of(scratch.path()), frf.name, frf.fingerprint);
}

FrfHandle frf_of_state(const py::tuple& state) {
  const OutputFile scratch(scratch_name("stageid.h5"));
  fill(scratch.path(), state[0].cast<py::bytes>());
  return {read_frf(scratch.path()), state[1].cast<std::string>(), state[2].cast<std::string>()};
}

py::bytes state_of(const AdditiveModel& model) {
  const OutputFile scratch(scratch_name("stageid.json"));
  write_model(scratch.path(), model);
  return content_of(scratch.path());
}

AdditiveModel model_of_state(const py::bytes& state) {
  const OutputFile scratch(scratch_name("stageid.json"));
  fill(scratch.path(), state);
  return read_model(scratch.path());
}

py::tuple state_of(const FitResult& fit) {
  const FitCovariance& c = fit.covariance;
  return py::make_tuple(
      state_of(fit.model), fit.message(), fit.parameters, fit.cost, fit.decisions, fit.findings,
      ranks_state(fit.residue_ranks), fit.removal_cost, fit.held, fit.frozen, fit.response_variance,
      py::make_tuple(c.sandwich, c.likelihood, c.response_variance, c.response_radius));
}

FitResult fit_of_state(const py::tuple& state) {
  FitResult fit;
  fit.model = model_of_state(state[0].cast<py::bytes>());
  fit.model.fit.message = state[1].cast<std::string>();
  fit.parameters = state[2].cast<Eigen::Index>();
  fit.cost = state[3].cast<std::vector<double>>();
  fit.decisions = state[4].cast<std::vector<std::string>>();
  fit.findings = state[5].cast<std::vector<std::string>>();
  fit.residue_ranks = ranks_of(state[6]);
  fit.removal_cost = state[7].cast<std::vector<double>>();
  fit.held = state[8].cast<std::vector<std::size_t>>();
  fit.frozen = state[9].cast<std::vector<Eigen::Index>>();
  fit.response_variance = state[10].cast<Eigen::MatrixXd>();
  const auto covariance = state[11].cast<py::tuple>();
  fit.covariance = {covariance[0].cast<Eigen::MatrixXd>(), covariance[1].cast<Eigen::MatrixXd>(),
                    covariance[2].cast<Eigen::MatrixXd>(), covariance[3].cast<Eigen::MatrixXd>()};
  return fit;
}

py::tuple state_of(const LogReader& log) {
  const auto* in_memory = dynamic_cast<const ArrayLog*>(&log);
  if (in_memory == nullptr) return py::make_tuple(std::filesystem::absolute(log.path()).string());
  const LogInfo& info = log.info();
  const ExperimentArrays& a = in_memory->arrays();
  return py::make_tuple(log.path().string(), info.sample_rate_hz, info.period_samples,
                        info.transient_periods, channels_state(info.excitation),
                        channels_state(info.actuators), channels_state(info.sensors),
                        info.metadata_json, a.excitation, a.actuators, a.sensors,
                        a.marked ? py::object(*a.marked) : py::object(py::none()));
}

std::shared_ptr<LogReader> log_of_state(const py::tuple& state) {
  const auto name = state[0].cast<std::string>();
  if (state.size() == 1) return open_log(name);
  LogInfo info;
  info.sample_rate_hz = state[1].cast<double>();
  info.period_samples = state[2].cast<int>();
  info.transient_periods = state[3].cast<int>();
  info.excitation = channels_of(state[4]);
  info.actuators = channels_of(state[5]);
  info.sensors = channels_of(state[6]);
  info.metadata_json = state[7].cast<std::string>();
  return std::make_shared<ArrayLog>(name, std::move(info),
                                    experiment_arrays(state[8], state[9], state[10], state[11]));
}

}  // namespace stageid

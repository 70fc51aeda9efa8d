#include "tools/python/pickles.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <tuple>
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

// The members that a pickle holds, in the order of its state: to be read from or assigned to.
template <typename Rank>
auto members_of_rank(Rank& t) {
  return std::tie(t.submodel, t.natural_frequency_hz, t.rank, t.chi_square, t.parameters,
                  t.probability);
}

template <typename Fit>
auto members_of_fit(Fit& fit) {
  auto& c = fit.covariance;
  return std::tie(fit.model.fit.message, fit.parameters, fit.cost, fit.decisions, fit.findings,
                  fit.removal_cost, fit.held, fit.frozen, fit.response_variance, c.sandwich,
                  c.likelihood, c.response_variance, c.response_radius);
}

template <typename Info>
auto members_of_info(Info& info) {
  return std::tie(info.sample_rate_hz, info.period_samples, info.transient_periods,
                  info.excitation.names, info.excitation.units, info.actuators.names,
                  info.actuators.units, info.sensors.names, info.sensors.units, info.metadata_json);
}

template <typename... Member>
void assign(std::tuple<Member&...> members, const py::handle& state) {
  members = state.cast<std::tuple<Member...>>();
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
  py::list ranks;
  for (const ResidueRankTest& test : fit.residue_ranks)
    ranks.append(py::cast(members_of_rank(test)));
  return py::make_tuple(state_of(fit.model), members_of_fit(fit), ranks);
}

FitResult fit_of_state(const py::tuple& state) {
  FitResult fit;
  fit.model = model_of_state(state[0].cast<py::bytes>());
  assign(members_of_fit(fit), state[1]);
  for (const py::handle rank : state[2])
    assign(members_of_rank(fit.residue_ranks.emplace_back()), rank);
  return fit;
}

py::tuple state_of(const LogReader& log) {
  const auto* in_memory = dynamic_cast<const ArrayLog*>(&log);
  if (in_memory == nullptr) return py::make_tuple(std::filesystem::absolute(log.path()).string());
  const ExperimentArrays& a = in_memory->arrays();
  return py::make_tuple(log.path().string(), members_of_info(log.info()), a.excitation, a.actuators,
                        a.sensors, a.marked ? py::object(*a.marked) : py::object(py::none()));
}

std::shared_ptr<LogReader> log_of_state(const py::tuple& state) {
  const auto name = state[0].cast<std::string>();
  if (state.size() == 1) return open_log(name);
  LogInfo info;
  assign(members_of_info(info), state[1]);
  return std::make_shared<ArrayLog>(name, std::move(info),
                                    experiment_arrays(state[2], state[3], state[4], state[5]));
}

}  // namespace stageid

#include "tools/watch/track_file.hpp"

#include <limits>
#include <string>
#include <vector>

namespace stageid {
namespace {

constexpr hsize_t kChunkRows = 64;

}  // namespace

TrackFile::TrackFile(const std::filesystem::path& file, const ModelTracker& tracker,
                     const AdditiveModel& model, const std::filesystem::path& model_file)
    : output_(file), hdf5_(Hdf5File::create(output_.path(), file)) {
  const auto columns = static_cast<hsize_t>(tracker.parameters().size());
  hdf5_.write_attribute("/", "format", std::string("stageid-watch"));
  hdf5_.write_attribute("/", "format_version", 1LL);
  hdf5_.write_attribute("/", "model", model_file.string());
  std::vector<std::string> names;
  std::vector<std::string> kinds;
  for (const TrackedParameter& parameter : tracker.parameters()) {
    names.push_back(describe(parameter, model));
    kinds.emplace_back(to_string(parameter.kind));
  }
  hdf5_.write_texts("/names", names);
  hdf5_.write_texts("/kinds", kinds);
  hdf5_.write_texts("/sensors", model.outputs.names);
  for (const char* scalar : {"/time_s", "/learning", "/statistic", "/threshold"})
    hdf5_.create_growing(scalar, 0, H5T_IEEE_F64LE, kChunkRows);
  for (const char* row : {"/change", "/deviation"})
    hdf5_.create_growing(row, columns, H5T_IEEE_F64LE, kChunkRows);
  hdf5_.create_growing("/noise_power", model.outputs.size(), H5T_IEEE_F64LE, kChunkRows);
}

void TrackFile::add(const WatchedPeriod& period, const TrackedPeriod& state,
                    const ModelTracker& tracker) {
  const double learning = state.learning ? 1.0 : 0.0;
  hdf5_.append_rows("/time_s", 1, &period.time_s);
  hdf5_.append_rows("/learning", 1, &learning);
  hdf5_.append_rows("/statistic", 1, &state.largest_statistic);
  hdf5_.append_rows("/threshold", 1, &state.threshold);
  const Eigen::VectorXd deviation = tracker.covariance().diagonal().cwiseSqrt();
  hdf5_.append_rows("/change", 1, tracker.estimate().data());
  hdf5_.append_rows("/deviation", 1, deviation.data());
  const Eigen::VectorXd unknown =
      Eigen::VectorXd::Constant(static_cast<Eigen::Index>(hdf5_.shape("/noise_power")[1]),
                                std::numeric_limits<double>::quiet_NaN());
  hdf5_.append_rows("/noise_power", 1,
                    state.noise_power.size() > 0 ? state.noise_power.data() : unknown.data());
}

void TrackFile::commit() {
  hdf5_.close();
  output_.commit();
}

}  // namespace stageid

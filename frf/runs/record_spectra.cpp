#include "frf/runs/record_spectra.hpp"

#include <fmt/format.h>

#include <numeric>
#include <optional>
#include <utility>

#include "frf/periods/record_glitches.hpp"
#include "frf/runs/health_gathering.hpp"
#include "frf/runs/transient_model.hpp"

namespace stageid {
namespace {

/// Largest number of periods that are transformed together. More would only need memory: the noise of the mean is the
/// same, and a window of 16 bins is narrow enough.
constexpr int kLongest = 16;

/// Consecutive clean periods: samples of the selected channels, outputs, estimated, excluded.
struct Segment {
  Eigen::MatrixXd samples;  ///< the first `periods` periods are valid
  int first = 0;            ///< first period within the run
  int periods = 0;
};

/// One run in progress, segment by segment.
class RecordMeasurement {
 public:
  RecordMeasurement(const UsedRun& used, const ExcitationSpectrum& excitation,
                    const ChannelChoice& channels, PeriodChoice choice, RunWorkspace& workspace)
      : used_(used),
        excitation_(excitation),
        channels_(channels),
        choice_(choice),
        w_(workspace),
        N_(workspace.dft.length()),
        outputs_(std::ssize(channels.outputs)),
        n_(outputs_ + std::ssize(channels.estimated)) {
    const int segments = (used.periods + kLongest - 1) / kLongest;
    longest_ = (used.periods + segments - 1) / segments;
    const auto excluded = std::ssize(channels.excluded);
    segment_.samples.resize(N_ * longest_, n_ + excluded);
    w_.excluded_sum.setZero(N_, excluded);
  }

  void add_excitation(const Eigen::MatrixXd& period) { add_matrix(fingerprint_, period); }

  /// Adds the period in workspace.samples.
  void take(int period) {
    if (segment_.periods == 0) segment_.first = period;
    Eigen::Index column = 0;
    const auto copy = [&](const Eigen::MatrixXd& samples, const std::vector<Eigen::Index>& which) {
      for (const Eigen::Index c : which)
        segment_.samples.col(column++).segment(segment_.periods * N_, N_) = samples.col(c);
    };
    copy(w_.samples.sensors, channels_.outputs);
    copy(w_.samples.actuators, channels_.estimated);
    copy(w_.samples.actuators, channels_.excluded);
    if (++segment_.periods == longest_) close_segment();
  }

  void leave_out(int period, const std::string& why) {
    close_segment();
    run_.drop(used_.run(), period, why);
  }

  RunSpectra finish() {
    close_segment();
    if (run_.periods == 0 && alone_) include(*std::exchange(alone_, std::nullopt));
    if (run_.periods == 0) return std::move(run_);
    run_.mean /= static_cast<double>(run_.periods);
    run_.excluded_power = excluded_power(excitation_.lines, run_.periods, w_);
    run_.fingerprint = fingerprint_.hex();
    return std::move(run_);
  }

 private:
  /// A single period is less accurate, because its noise must be estimated on empty lines. It is used only if there is
  /// nothing else.
  void settle(const Segment& segment) {
    if (segment.periods == 1 && used_.periods > 1) {
      if (run_.periods == 0 && !alone_) {
        alone_ = segment;
      } else {
        drop_alone(segment);
      }
    } else if (segment.periods > 0) {
      include(segment);
      if (alone_) drop_alone(*std::exchange(alone_, std::nullopt));
    }
  }

  /// Includes the parts between the periods with a glitch, if there are any.
  void close_segment() {
    std::vector<Glitch> glitches;
    if (choice_ == PeriodChoice::consistent)
      glitches = find_glitches(segment_.samples, n_, N_, segment_.periods);
    if (glitches.empty()) {
      settle(segment_);
    } else {
      int begin = 0;
      const int end = segment_.periods;
      for (const Glitch& glitch : glitches) {
        settle(part(begin, glitch.period));
        run_.deviating.push_back(segment_.first + glitch.period);
        run_.drop(used_.run(), segment_.first + glitch.period,
                  fmt::format("a glitch: {} deviates by {:.3g} times the surrounding noise",
                              channels_.name(used_.log->info(), glitch.channel), glitch.ratio));
        begin = glitch.period + 1;
      }
      settle(part(begin, end));
    }
    segment_.periods = 0;
  }

  Segment part(int begin, int end) const {
    return {segment_.samples.middleRows(begin * N_, (end - begin) * N_), segment_.first + begin,
            end - begin};
  }

  void drop_alone(const Segment& segment) {
    run_.drop(used_.run(), segment.first, "too short for a record between marked periods");
  }

  void include(const Segment& segment) {
    const Eigen::Index rows = N_ * segment.periods;
    add_matrix(fingerprint_, Eigen::MatrixXd(segment.samples.topRows(rows)));
    const TransientModel model(static_cast<int>(N_), segment.periods, excitation_, outputs_,
                               used_.place());
    RunSpectra part;
    model.separate(spectrum(segment.samples, rows, model.bins()), part);
    const Eigen::Index excluded = w_.excluded_sum.cols();
    for (int p = 0; p < segment.periods; ++p)
      w_.excluded_sum += segment.samples.rightCols(excluded).middleRows(p * N_, N_);
    if (run_.periods == 0) {
      run_.mean.setZero(part.mean.rows(), part.mean.cols());
      run_.scatter_re = w_.pool.take(part.scatter_re.rows(), part.scatter_re.cols());
      run_.scatter_im = w_.pool.take(part.scatter_im.rows(), part.scatter_im.cols());
      run_.scatter_re.setZero();
      run_.scatter_im.setZero();
      run_.line_dof.setZero(part.mean.cols());
      run_.scatter_window = part.scatter_window;  // stretches have nearly equal lengths
      run_.scatter_first = std::move(part.scatter_first);
    }
    run_.periods += segment.periods;
    run_.mean += static_cast<double>(segment.periods) * part.mean;
    run_.scatter_re += part.scatter_re;  // scaled for single periods, for any number of them
    run_.scatter_im += part.scatter_im;
    run_.scatter_dof += part.scatter_dof;
    run_.line_dof += part.line_dof;
  }

  /// DFT / number of samples of the first `rows` samples, outputs and estimated x bins.
  Eigen::MatrixXcd spectrum(const Eigen::MatrixXd& samples, Eigen::Index rows,
                            Eigen::Index bins) const {
    RealDft dft(static_cast<int>(rows));
    Eigen::MatrixXcd Z(n_, bins);
    std::vector<int> all(bins);
    std::iota(all.begin(), all.end(), 0);
    line_spectra(samples.topRows(rows), first_indices(n_), all, 0, dft, Z);
    return Z;
  }

  const UsedRun& used_;
  const ExcitationSpectrum& excitation_;
  const ChannelChoice& channels_;
  PeriodChoice choice_;
  RunWorkspace& w_;
  Eigen::Index N_;
  Eigen::Index outputs_;
  Eigen::Index n_;
  int longest_ = 1;
  Fingerprint fingerprint_;
  Segment segment_;
  std::optional<Segment> alone_;  // a single period, used only without longer segments
  RunSpectra run_;
};

}  // namespace

RunSpectra measure_record(const UsedRun& used, const RunExcitation& excitation,
                          const ChannelChoice& channels, PeriodChoice choice, RunWorkspace& w,
                          HealthPart* health, const ReadDone& read_done) {
  RecordMeasurement measurement(used, excitation.spectrum, channels, choice, w);
  measurement.add_excitation(excitation.period);
  const auto take = [&](int p) {
    measurement.take(p);
    return nullptr;
  };
  read_periods(used, excitation.period, w, health, read_done, take,
               [&](int p, const std::string& why) { measurement.leave_out(p, why); });
  return measurement.finish();
}

}  // namespace stageid

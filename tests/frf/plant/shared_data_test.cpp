// Data of other programs, not included in the source tree.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <vector>

#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/multisine/dft.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/plant/plant_frf.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid::test_shared_data {

namespace fs = std::filesystem;

fs::path shared_data() { return fs::path(STAGEID_SOURCE_DIR) / ".." / "shared" / "data"; }

#define SKIP_UNLESS(path)                                                       \
  if (!fs::exists(path)) {                                                      \
    GTEST_SKIP() << "not there: " << (path).string() << "; nothing was tested"; \
  }

/// The reference: mean over realizations of Y U^-1, spectra by a plain DFT of the averaged periods.
Eigen::MatrixXcd plain_estimate(const LogReader& log, const std::vector<int>& lines) {
  const LogInfo& info = log.info();
  const Eigen::Index n = info.period_samples;
  const auto n_y = std::ssize(info.sensors);
  const auto n_u = std::ssize(info.actuators);
  const auto n_lines = std::ssize(lines);
  const auto n_runs = static_cast<Eigen::Index>(log.runs().size());
  const Eigen::Index realizations = n_runs / n_u;
  RealDft dft(info.period_samples);
  Eigen::MatrixXcd mean = Eigen::MatrixXcd::Zero(n_y * n_u, n_lines);
  for (Eigen::Index m = 0; m < realizations; ++m) {
    std::vector<Eigen::MatrixXcd> Z(lines.size(), Eigen::MatrixXcd(n_y + n_u, n_u));
    for (Eigen::Index e = 0; e < n_u; ++e) {
      const auto run = static_cast<std::size_t>(m * n_u + e);
      LogSamples samples;
      log.read(run, 0, log.runs()[run].samples, samples);
      Eigen::MatrixXd all(samples.sensors.rows(), n_y + n_u);
      all << samples.sensors, samples.actuators;
      for (Eigen::Index c = 0; c < all.cols(); ++c) {
        Eigen::VectorXd period = Eigen::VectorXd::Zero(n);
        const Eigen::Index periods = all.rows() / n - info.transient_periods;
        for (Eigen::Index p = 0; p < periods; ++p) {
          period += all.col(c).segment((info.transient_periods + p) * n, n) /
                    static_cast<double>(periods);
        }
        const auto spectrum = dft.forward(period);
        for (std::size_t k = 0; k < lines.size(); ++k) {
          Z[k](c, e) = spectrum[static_cast<std::size_t>(lines[k])];
        }
      }
    }
    for (std::size_t k = 0; k < lines.size(); ++k) {
      const Eigen::MatrixXcd G = Z[k].topRows(n_y) * inverse(Z[k].bottomRows(n_u));
      mean.col(static_cast<Eigen::Index>(k)) +=
          Eigen::Map<const Eigen::VectorXcd>(G.data(), G.size()) /
          static_cast<double>(realizations);
    }
  }
  return mean;
}

double median_error(const Eigen::MatrixXcd& response, const Eigen::MatrixXcd& truth,
                    const Eigen::VectorXd& frequency_hz, double low_hz, double high_hz) {
  std::vector<double> errors;
  for (Eigen::Index k = 0; k < truth.cols(); ++k) {
    if (frequency_hz[k] < low_hz || frequency_hz[k] >= high_hz) continue;
    errors.push_back((response.col(k) - truth.col(k)).norm() / truth.col(k).norm());
  }
  return order_statistic(errors, 0.5);
}

TEST(SharedData, TheForeignLogGivesThePlantItWasMadeWith) {
  const fs::path folder = shared_data() / "foreign_log";
  SKIP_UNLESS(folder / "log.h5");
  SKIP_UNLESS(folder / "truth.h5");
  const auto log = open_log(folder / "log.h5");
  const FrfEstimate frf = estimate_plant_frf({log.get()});

  const Hdf5File file = Hdf5File::open(folder / "truth.h5");
  const std::vector<double> frequency = file.read_reals("/frequency_hz");
  const std::vector<std::complex<double>> data = file.read_complex("/response_sampled");
  ASSERT_EQ(frf.lines(), std::ssize(frequency));
  ASSERT_EQ(frf.n_outputs(), 4);
  ASSERT_EQ(frf.n_inputs(), 13);
  Eigen::MatrixXcd truth(52, frf.lines());
  std::vector<int> lines;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    EXPECT_NEAR(frf.frequency_hz[k], frequency[static_cast<std::size_t>(k)], 1e-9);
    lines.push_back(static_cast<int>(std::lround(frf.frequency_hz[k] * 2.0)));
    for (Eigen::Index i = 0; i < 4; ++i) {
      for (Eigen::Index j = 0; j < 13; ++j) {
        truth(i + 4 * j, k) = data[static_cast<std::size_t>((k * 4 + i) * 13 + j)];
      }
    }
  }
  const Eigen::MatrixXcd plain = plain_estimate(*log, lines);
  const double bands_hz[][2] = {{5, 20}, {20, 100}, {100, 400}, {400, 1000}};
  for (const auto& band : bands_hz) {
    const double ours = median_error(frf.response, truth, frf.frequency_hz, band[0], band[1]);
    const double reference = median_error(plain, truth, frf.frequency_hz, band[0], band[1]);
    EXPECT_LT(ours, 1.05 * reference) << band[0] << " Hz to " << band[1] << " Hz";
  }

  // The noise variance against the deviation from the truth: mean of |dG|^2 / Var over lines and entries of the quiet
  // band, where the rest of the transient is negligible.
  double ratio = 0.0;
  Eigen::Index count = 0;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    if (frf.frequency_hz[k] < 400.0) continue;
    ratio +=
        ((frf.response.col(k) - truth.col(k)).array().abs2() / frf.noise_variance.col(k).array())
            .sum();
    count += 52;
  }
  ratio /= static_cast<double>(count);
  EXPECT_GT(ratio, 0.85);
  EXPECT_LT(ratio, 1.3);
}

TEST(SharedData, FrequencyResponsesOfOtherProgramsLoad) {
  const fs::path folder = shared_data() / "frf";
  SKIP_UNLESS(folder);
  int files = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".h5") continue;
    ++files;
    const FrfEstimate frf = read_frf(entry.path());
    EXPECT_GT(frf.lines(), 1) << entry.path();
    EXPECT_EQ(frf.hold, Hold::none) << entry.path();
  }
  EXPECT_GT(files, 0);
}

}  // namespace stageid::test_shared_data

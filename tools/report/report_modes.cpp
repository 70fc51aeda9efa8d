#include "tools/report/report_modes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stageid {
namespace {

std::optional<double> deviation(std::optional<double> estimate, std::optional<double> truth,
                                std::optional<double> std) {
  if (!estimate || !truth || !std || !(*std > 0.0)) return std::nullopt;
  return (*estimate - *truth) / *std;
}

std::vector<ModeRow> identified(const AdditiveModel& model) {
  std::vector<ModeRow> rows;
  for (const Submodel& submodel : model.submodels) {
    if (!submodel.is_mode()) continue;
    rows.push_back({.frequency_hz = submodel.natural_frequency_hz(),
                    .damping_ratio = submodel.damping_ratio(),
                    .frequency_std_hz = submodel.natural_frequency_std_hz,
                    .damping_std = submodel.damping_ratio_std,
                    .truth = std::nullopt});
  }
  std::ranges::sort(rows, {}, [](const ModeRow& row) { return *row.frequency_hz; });
  return rows;
}

/// Pairs that never cross, by dynamic programming as for the alignment of two sequences. An unpaired mode costs
/// `furthest`, so every closer pair is preferred.
class Alignment {
 public:
  Alignment(const std::vector<ModeRow>& rows, const std::vector<TrueMode>& truth, double furthest)
      : rows_(rows), truth_(truth), furthest_(furthest) {
    cost_ = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(rows.size()) + 1,
                                  static_cast<Eigen::Index>(truth.size()) + 1);
    for (Eigen::Index i = cost_.rows() - 1; i >= 0; --i)
      for (Eigen::Index j = cost_.cols() - 1; j >= 0; --j) cost_(i, j) = best(i, j);
  }

  /// Index of the true mode per row, -1 for none.
  std::vector<int> partners() const {
    std::vector<int> partner(rows_.size(), -1);
    Eigen::Index i = 0;
    Eigen::Index j = 0;
    while (i < cost_.rows() - 1 && j < cost_.cols() - 1) {
      if (cost_(i, j) == pair(i, j) + cost_(i + 1, j + 1))
        partner[static_cast<std::size_t>(i++)] = static_cast<int>(j++);
      else if (cost_(i, j) == furthest_ + cost_(i + 1, j))
        ++i;
      else
        ++j;
    }
    return partner;
  }

 private:
  double pair(Eigen::Index i, Eigen::Index j) const {
    const double f = truth_[static_cast<std::size_t>(j)].natural_frequency_hz;
    const double apart = std::abs(*rows_[static_cast<std::size_t>(i)].frequency_hz - f) / f;
    return apart <= furthest_ ? apart : std::numeric_limits<double>::infinity();
  }
  double best(Eigen::Index i, Eigen::Index j) const {
    const bool row = i < cost_.rows() - 1;
    const bool column = j < cost_.cols() - 1;
    if (!row && !column) return 0.0;
    double least = std::numeric_limits<double>::infinity();
    if (row) least = std::min(least, furthest_ + cost_(i + 1, j));
    if (column) least = std::min(least, furthest_ + cost_(i, j + 1));
    if (row && column) least = std::min(least, pair(i, j) + cost_(i + 1, j + 1));
    return least;
  }

  const std::vector<ModeRow>& rows_;
  const std::vector<TrueMode>& truth_;
  double furthest_;
  Eigen::MatrixXd cost_;
};

double place(const ModeRow& row) {
  return row.frequency_hz ? *row.frequency_hz : row.truth->natural_frequency_hz;
}

}  // namespace

std::optional<double> ModeRow::frequency_deviation() const {
  if (!truth) return std::nullopt;
  return deviation(frequency_hz, truth->natural_frequency_hz, frequency_std_hz);
}

std::optional<double> ModeRow::damping_deviation() const {
  if (!truth) return std::nullopt;
  return deviation(damping_ratio, truth->damping_ratio, damping_std);
}

std::optional<double> ModeRow::relative_frequency_error() const {
  if (!truth || !frequency_hz) return std::nullopt;
  return std::abs(*frequency_hz / truth->natural_frequency_hz - 1.0);
}

std::vector<ModeRow> mode_table(const AdditiveModel& model, std::span<const TrueMode> truth,
                                double furthest) {
  std::vector<TrueMode> known(truth.begin(), truth.end());
  std::ranges::sort(known, {}, &TrueMode::natural_frequency_hz);
  std::vector<ModeRow> rows = identified(model);
  const std::vector<int> partner = Alignment(rows, known, furthest).partners();

  std::vector<bool> found(known.size(), false);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (partner[i] < 0) continue;
    rows[i].truth = known[static_cast<std::size_t>(partner[i])];
    found[static_cast<std::size_t>(partner[i])] = true;
  }
  for (std::size_t j = 0; j < known.size(); ++j) {
    if (found[j]) continue;
    ModeRow missing;
    missing.truth = known[j];
    rows.push_back(missing);
  }
  std::ranges::stable_sort(rows, {}, place);
  return rows;
}

}  // namespace stageid

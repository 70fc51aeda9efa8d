#include "tools/fit/frf_quality.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "frf/health/estimate_check.hpp"
#include "frf/response/nonlinearity.hpp"
#include "frf/response/nonlinearity_sentence.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {
namespace {

constexpr std::size_t kMostLines = 10;

/// The least probable verdict of a column.
struct Verdict {
  Eigen::Index at = 0;
  double p_value = 1.0;
};

Verdict least(const Eigen::MatrixXd& p_value, Eigen::Index band) {
  Verdict verdict;
  verdict.p_value = p_value.col(band).minCoeff(&verdict.at);
  return verdict;
}

std::string detected(const DetectedDistortion& found, Eigen::Index band) {
  if (found.p_value.size() == 0) return "-";
  const Verdict verdict = least(found.p_value, band);
  if (verdict.p_value >= kNonlinearBelow / static_cast<double>(found.p_value.rows())) return "-";
  return decibels(found.level(verdict.at, band));
}

Json detected_json(const DetectedDistortion& found, Eigen::Index band) {
  if (found.p_value.size() == 0) return nullptr;
  const Verdict verdict = least(found.p_value, band);
  return {{"p_value", verdict.p_value}, {"level", found.level(verdict.at, band)}};
}

std::size_t unsettled_bands(const NonlinearityTest& test) {
  std::size_t count = 0;
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b) count += test.settled(b) ? 0 : 1;
  return count;
}

std::string unsettled_line(const NonlinearityTest& test) {
  if (is_withdrawn(test))
    return "linearity cannot be tested: the data health names what makes the realizations differ";
  return fmt::format(
      "linearity cannot be tested in {} of {} bands, because the records are not settled there: {}",
      unsettled_bands(test), test.band_hz.rows(), kUnsettledRemedy);
}

std::string conclusion(const NonlinearityTest& test) {
  const std::size_t tests = static_cast<std::size_t>(test.p_value.size()) -
                            unsettled_bands(test) * static_cast<std::size_t>(test.p_value.rows());
  const std::string chance =
      fmt::format("of a linear plant {:.1f} of {} pairs and bands appear nonlinear by chance",
                  kNonlinearBelow * static_cast<double>(tests), tests);
  if (!test.nonlinear()) return "no evidence of nonlinearity: " + chance;
  return fmt::format("the plant is nonlinear: {}, but the smallest p value here is {:.0e}", chance,
                     std::max(test.least_p_value(), 1e-300));
}

std::string why_not_tested(const FrfEstimate& frf) {
  const std::string why = why_linearity_cannot_be_tested(frf);
  return why.empty()
             ? "nonlinearity test: the file contains none; estimate the FRF again from the logs"
             : why;
}

Json linearity_json(const FrfEstimate& frf) {
  const NonlinearityTest& test = frf.nonlinearity;
  if (test.band_hz.rows() == 0) return {{"tested", false}, {"reason", why_not_tested(frf)}};
  Json bands = Json::array();
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b) {
    const Verdict verdict = least(test.p_value, b);
    bands.push_back({{"band_hz", {test.band_hz(b, 0), test.band_hz(b, 1)}},
                     {"settled", test.settled(b)},
                     {"tests", test.p_value.rows()},
                     {"nonlinear", (test.p_value.col(b).array() < kNonlinearBelow).count()},
                     {"output", frf.outputs.name(verdict.at % frf.n_outputs())},
                     {"input", frf.inputs.name(verdict.at / frf.n_outputs())},
                     {"p_value", verdict.p_value},
                     {"distortion", test.distortion(verdict.at, b)},
                     {"even", detected_json(test.even, b)},
                     {"odd", detected_json(test.odd, b)}});
  }
  return {{"tested", true},
          {"nonlinear", test.nonlinear()},
          {"false_alarm_rate", kNonlinearBelow},
          {"bands", bands}};
}

}  // namespace

std::vector<std::string> linearity_lines(const FrfEstimate& frf) {
  const NonlinearityTest& test = frf.nonlinearity;
  if (test.band_hz.rows() == 0) return {why_not_tested(frf)};
  std::vector<std::vector<std::string>> rows = {
      {"band, Hz", "nonlinear pairs", "most", "distortion", "even lines", "odd lines"}};
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b) {
    const Verdict verdict = least(test.p_value, b);
    const auto count = (test.p_value.col(b).array() < kNonlinearBelow).count();
    const std::string band =
        fmt::format("{:.4g} ... {:.4g}", test.band_hz(b, 0), test.band_hz(b, 1));
    if (!test.settled(b)) {
      rows.push_back({band, "not settled", "-", "-", "-", "-"});
      continue;
    }
    rows.push_back({band, fmt::format("{} of {}", count, test.p_value.rows()),
                    count > 0 ? pair_name(frf, verdict.at) : "-",
                    count > 0 ? decibels(test.distortion(verdict.at, b)) : "-",
                    detected(test.even, b), detected(test.odd, b)});
  }
  std::vector<std::string> lines = table_lines(rows);
  const std::size_t unsettled = unsettled_bands(test);
  if (unsettled > 0) lines.push_back(unsettled_line(test));
  if (unsettled < static_cast<std::size_t>(test.band_hz.rows())) lines.push_back(conclusion(test));
  return lines;
}

std::vector<std::string> dropped_lines(const FrfEstimate& frf) {
  std::vector<std::string> lines;
  std::set<int> left_out;
  for (const LeftOutRealization& one : frf.left_out_realizations) {
    left_out.insert(one.realization);
    lines.push_back(fmt::format("realization {} discarded, the others are used: {}",
                                one.realization + 1, one.reason));
  }
  const auto tell = [&](const auto& items, const auto& text_of, const char* others) {
    std::size_t count = 0;
    for (const auto& one : items) {
      if (left_out.contains(one.realization)) continue;
      if (++count > kMostLines) continue;
      lines.push_back(fmt::format("realization {}, experiment {}: {}: {}", one.realization + 1,
                                  one.experiment + 1, text_of(one), one.reason));
    }
    if (count > kMostLines)
      lines.push_back(fmt::format("... and {} more {}", count - kMostLines, others));
  };
  tell(
      frf.dropped_periods,
      [](const DroppedPeriod& one) { return fmt::format("period {} discarded", one.period + 1); },
      "periods, listed in /dropped_periods");
  tell(
      frf.replaced_samples,
      [](const ReplacedSamples& one) {
        return fmt::format("samples {} ... {} of period {} replaced, the others are used",
                           one.first + 1, one.first + one.samples, one.period + 1);
      },
      "replacements, listed in /replaced_samples");
  if (const int starts = runs_with_discarded_start(frf); starts > 0)
    lines.push_back(fmt::format(
        "the first measured period of {} of {} experiments was discarded: the transient was not "
        "over, and its remainder resembles distortion; increase --transient-periods by one, or "
        "use --method lpm",
        starts, frf.realizations * frf.experiments));
  return lines;
}

Json quality_json(const FrfEstimate& frf) {
  Json json = {{"nonlinearity", linearity_json(frf)},
               {"dropped_periods", Json::array()},
               {"replaced_samples", Json::array()},
               {"left_out_realizations", Json::array()}};
  for (const DroppedPeriod& period : frf.dropped_periods)
    json["dropped_periods"].push_back({{"realization", period.realization + 1},
                                       {"experiment", period.experiment + 1},
                                       {"period", period.period + 1},
                                       {"reason", period.reason}});
  for (const ReplacedSamples& one : frf.replaced_samples)
    json["replaced_samples"].push_back({{"realization", one.realization + 1},
                                        {"experiment", one.experiment + 1},
                                        {"period", one.period + 1},
                                        {"first_sample", one.first + 1},
                                        {"samples", one.samples},
                                        {"reason", one.reason}});
  for (const LeftOutRealization& one : frf.left_out_realizations)
    json["left_out_realizations"].push_back(
        {{"realization", one.realization + 1}, {"reason", one.reason}});
  return json;
}

}  // namespace stageid

#include "tools/fleet/fleet_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/files/key_suggestion.hpp"
#include "acquisition/files/version.hpp"
#include "frf/statistics/order_statistic.hpp"
#include "tools/fleet/fleet_jobs.hpp"
#include "tools/fleet/fleet_time.hpp"
#include "tools/report/html_page.hpp"
#include "tools/report/report_encoding.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {
namespace {

constexpr unsigned char kNoFolder = 255;

/// For display; the page would be larger with all digits.
double rounded(double value) { return std::strtod(fmt::format("{:.7g}", value).c_str(), nullptr); }

constexpr int kNoisy = 4;  // level of compression
constexpr double kMostSteps = 30000.0;

std::uint16_t sign_last(int value) {
  return static_cast<std::uint16_t>(value < 0 ? -2 * value - 1 : 2 * value);
}

/// Eighths of an octave from 2^-16.
std::uint8_t std_code(double ratio) {
  return static_cast<std::uint8_t>(std::clamp(std::lround(8.0 * std::log2(ratio)) + 128, 1L, 255L));
}

/// Six bytes from 12 hexadecimal digits; others count as zero.
void append_hex(std::vector<std::uint8_t>& bytes, std::string hex) {
  hex.resize(kFolderDigits, '0');
  for (std::size_t i = 0; i < hex.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::strtol(hex.substr(i, 2).c_str(), nullptr, 16)));
}

/// The numbers of the page of a fleet, packed. tools/fleet/js/series.js is the reader.
class FleetSeries {
 public:
  /// One identification. @param folder index of the folder of its job's folder; 255: no results
  void add_identification(double day, unsigned char verdict, unsigned char folder,
                          const std::string& job) {
    minutes_.push_back(std::round(day * 24.0 * 60.0));
    verdict_.push_back(verdict);
    folder_.push_back(folder);
    append_hex(job_, job);
  }

  /// The frequencies of one mode of a stage. They are rounded to a third of the median standard deviation, or to
  /// 1/30000 of their range if that is larger, and stored as differences of neighbours. Standard deviations are rounded
  /// by at most 5 %.
  /// @param present per identification of the stage
  /// @return number of values, least value and step, for the page
  SortedJson add_track(const std::vector<std::uint8_t>& present,
                       const std::vector<double>& frequency_hz,
                       const std::vector<double>& frequency_std_hz) {
    const auto [least, most] = std::ranges::minmax(frequency_hz);
    std::vector<double> std_hz = frequency_std_hz;
    const double step = std::max({median(std_hz) / 3.0, (most - least) / kMostSteps, 1e-12 * most});
    int before = 0;
    for (const double hz : frequency_hz) {
      const int place = static_cast<int>(std::lround((hz - least) / step));
      change_.push_back(sign_last(place - before));
      before = place;
    }
    present_.insert(present_.end(), present.begin(), present.end());
    for (const double value : frequency_std_hz)
      std_.push_back(value > 0.0 ? std_code(value / step) : std::uint8_t{0});
    return {frequency_hz.size(), least, step};
  }

  /// @param arrays descriptions for the page, per block
  std::vector<report::Block> blocks(SortedJson& arrays) const {
    std::vector<report::Block> out;
    const auto add = [&](const char* id, const char* type, std::string text) {
      arrays[id]["type"] = type;
      out.push_back({id, std::move(text)});
    };
    add("minutes", "f64",
        report::encode_float64(
            Eigen::Map<const Eigen::VectorXd>(minutes_.data(), std::ssize(minutes_))));
    add("verdict", "u8", report::packed(verdict_));
    add("folder", "u8", report::packed(folder_));
    add("job", "u8", report::packed(job_));
    add("present", "u8", report::packed(present_));
    add("change", "i16", report::packed(report::byte_planes(change_), kNoisy));
    add("std", "u8", report::packed(std_, kNoisy));
    return out;
  }

 private:
  std::vector<double> minutes_;
  std::vector<std::uint8_t> verdict_, folder_, job_, present_;
  std::vector<std::uint16_t> change_;
  std::vector<std::uint8_t> std_;
};

class FleetPage {
 public:
  FleetPage(const FleetStore& store, const FleetPageRequest& request)
      : database_(store.database()), request_(request) {}

  std::string html() {
    SortedJson stages = SortedJson::array();
    for (const auto& [name, id] : chosen_stages())
      if (SortedJson content = stage(id, name); content["count"] > 0)
        stages.push_back(std::move(content));
    if (count_ == 0)
      fail_request("{}: contains no identification of this time; change --since and --until",
                   database_.name());
    SortedJson content = {{"version", version()},
                          {"title", title()},
                          {"stages", stages},
                          {"track_keys",
                           {"mode", "frequency_hz", "spread_hz", "damping_ratio", "deviation",
                            "seen", "least", "step"}},
                          {"outliers", outliers_},
                          {"folders", folder_links()}};
    const std::vector<report::Block> blocks = series_.blocks(content["arrays"]);
    return html_page(HtmlPage::fleet, fmt::format("{}: fleet", title()),
                     script_safe(json_line(content)), blocks);
  }

 private:
  /// The name of the file or the database.
  std::string title() const {
    const std::string& name = database_.name();
    return std::filesystem::path(name.substr(0, name.find('?'))).stem().string();
  }

  std::vector<std::pair<std::string, std::int64_t>> chosen_stages() const {
    std::vector<std::pair<std::string, std::int64_t>> out;
    std::vector<std::string> names;
    const auto rows = database_.prepare("SELECT id, name FROM stage ORDER BY name");
    while (rows->step()) {
      names.push_back(rows->text(1));
      if (request_.stages.empty() || std::ranges::count(request_.stages, names.back()) > 0)
        out.emplace_back(names.back(), rows->integer(0));
    }
    for (const std::string& wanted : request_.stages)
      if (std::ranges::count(names, wanted) == 0)
        fail_request("--stage: unknown stage '{}'{}; 'stageid fleet query {} stages' lists them",
                     wanted,
                     nearest_word(wanted, names).empty()
                         ? ""
                         : fmt::format(", did you mean '{}'?", nearest_word(wanted, names)),
                     database_.name());
    return out;
  }

  /// "i" is the table identification; its parameters are those of bind_period().
  static constexpr const char* kOfPeriod =
      "WHERE i.stage_id = ? AND i.is_current = 1 AND i.time_utc >= ? AND i.time_utc < ? ORDER BY "
      "i.time_utc, i.job";

  std::unique_ptr<Statement> of_period(const std::string& select, std::int64_t stage) const {
    auto rows = database_.prepare(select + kOfPeriod);
    rows->bind(stage, request_.since, request_.until.empty() ? std::string("~") : request_.until);
    return rows;
  }

  unsigned char folder(const std::string& results) {
    if (results.empty()) return kNoFolder;
    const auto known = std::ranges::find(folders_, results);
    if (known != folders_.end()) return static_cast<unsigned char>(known - folders_.begin());
    if (folders_.size() == kNoFolder) return kNoFolder;
    folders_.push_back(results);
    return static_cast<unsigned char>(folders_.size() - 1);
  }

  /// From the folder of the page.
  SortedJson folder_links() const {
    SortedJson links = SortedJson::array();
    const auto of = [](const std::filesystem::path& file) {
      return std::filesystem::absolute(file).lexically_normal().parent_path();
    };
    for (const std::string& results : folders_)
      links.push_back((of(database_.name()) / results)
                          .lexically_normal()
                          .lexically_proximate(of(request_.output))
                          .generic_string());
    return links;
  }

  SortedJson stage(std::int64_t id, const std::string& name) {
    const auto rows = of_period(
        "SELECT i.id, i.time_utc, i.verdict, i.outlier, i.reasons, i.job, i.results "
        "FROM identification i ",
        id);
    std::map<std::int64_t, std::size_t> place;  // per identification
    std::size_t counts[3] = {0, 0, 0};          // per verdict
    const std::size_t first = count_;
    while (rows->step()) {
      const auto verdict =
          from_word<IdentificationVerdict>(rows->text(2)).value_or(IdentificationVerdict::failed);
      place[rows->integer(0)] = count_ - first;
      ++counts[static_cast<std::size_t>(verdict)];
      series_.add_identification(days_of(rows->text(1)).value_or(0.0),
                                 static_cast<unsigned char>(verdict), folder(rows->text(6)),
                                 rows->text(5));
      const bool doubtful = verdict != IdentificationVerdict::trustworthy;
      if (doubtful || !rows->is_null(3))
        outliers_.push_back({count_, doubtful ? rows->text(4) : "", rows->text(3)});
      if (++count_ > kMostOnPage)
        fail_request(
            "{}: more than {} identifications are too many for one page; choose some with --stage, "
            "--since and --until",
            database_.name(), kMostOnPage);
    }
    return {{"name", name},          {"first", first},      {"count", count_ - first},
            {"doubtful", counts[1]}, {"failed", counts[2]}, {"tracks", tracks(id, place)}};
  }

  SortedJson tracks(std::int64_t stage, const std::map<std::int64_t, std::size_t>& place) {
    struct Track {
      SortedJson about;
      std::vector<std::uint8_t> present;
      std::vector<double> frequency_hz;
      std::vector<double> std_hz;
    };
    std::map<std::int64_t, Track> by_track;
    std::vector<std::int64_t> in_order;  // of the modes
    const auto known = database_.prepare(
        "SELECT track, mode, frequency_hz, frequency_std_hz, damping_ratio, deviation FROM track "
        "WHERE stage_id = ? AND mode IS NOT NULL ORDER BY mode, track");
    known->bind(stage);
    while (known->step()) {
      in_order.push_back(known->integer(0));
      Track& track = by_track[in_order.back()];
      track.about = {known->integer(1), rounded(known->number(2)), rounded(known->number(3)),
                     rounded(known->number(4)),
                     known->is_null(5) ? SortedJson() : SortedJson(rounded(known->number(5)))};
      track.present.resize(place.size(), 0);
    }
    const auto rows = of_period(
        "SELECT i.id, m.track, m.frequency_hz, m.frequency_std_hz FROM identification i "
        "JOIN mode m ON m.identification_id = i.id ",
        stage);
    while (rows->step()) {
      const auto track = by_track.find(rows->integer(1));
      const auto day = place.find(rows->integer(0));
      if (rows->is_null(1) || track == by_track.end() || day == place.end()) continue;
      track->second.present[day->second] = 1;
      track->second.frequency_hz.push_back(rows->number(2));
      track->second.std_hz.push_back(rows->number(3));
    }
    SortedJson out = SortedJson::array();
    for (const std::int64_t number : in_order) {
      Track& track = by_track[number];
      if (track.frequency_hz.empty()) continue;
      for (const SortedJson& value :
           series_.add_track(track.present, track.frequency_hz, track.std_hz))
        track.about.push_back(value);
      out.push_back(std::move(track.about));
    }
    return out;
  }

  Database& database_;
  const FleetPageRequest& request_;
  FleetSeries series_;
  std::size_t count_ = 0;
  std::vector<std::string> folders_;
  SortedJson outliers_ = SortedJson::array();
};

}  // namespace

std::string fleet_page(const FleetStore& store, const FleetPageRequest& request) {
  return FleetPage(store, request).html();
}

}  // namespace stageid

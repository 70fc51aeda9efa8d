#include "tools/experiment/experiment_config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/key_suggestion.hpp"
#include "frf/plant/zippered_fit.hpp"
#include "tools/config/yaml_document.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/fit/fit_words.hpp"
#include "tools/terminal/format_errors.hpp"

namespace stageid {
namespace {

struct ExperimentFile {
  std::size_t format = 0;
  std::string stage;
  std::vector<std::string> axes;
  FlexibleValue rms_n;
  FlexibleValue peak_n;
  FlexibleValue lines = {"odd"};
  FlexibleValue shape = {"flat"};
  std::vector<std::pair<std::string, std::vector<double>>> phases;  // by axis
  std::vector<double> band_hz;
  double period_s = 0.0;
  ExperimentConfig config;  // without what is derived from the keys above
};

bool is_set(const FlexibleValue& value) { return !value.numbers.empty(); }

void describe_limits(ConfigVisitor& v, std::optional<LimitRequest>& limits) {
  LimitRequest request;
  std::string prior;
  v.text("prior", prior, kRequired,
         "plant data: frf.h5 of a pilot, or model.json, relative to this file");
  v.number("safety", request.safety, {"", 0.0, 1.0, true}, kOptional,
           "largest predicted share of any limit of the stage file");
  v.number("velocity_m_s", request.velocity_m_s, positive("m/s"), kOptional,
           "velocity limit of every sensor; omitted: no limit");
  request.prior = prior;
  limits = std::move(request);
}

/// The key without a unit in its name, for axes in any unit.
void describe_neutral(ConfigVisitor& v, const char* key, const char* si_key, FlexibleValue& value,
                      const FlexibleRule& rule) {
  FlexibleValue neutral;
  v.flexible(key, neutral, rule, kOptional, "the same in the units of the axes");
  v.require(!is_set(neutral) || !is_set(value), key,
            fmt::format("{}: is also given as {}; write one of them", key, si_key));
  if (is_set(neutral)) value = neutral;
}

void describe_level(ConfigVisitor& v, ExperimentFile& f) {
  FlexibleRule rule = {.number = true, .list = true, .rule = positive("N")};
  v.flexible("rms_n", f.rms_n, rule, kOptional, "rms of each axis; a list: one per axis");
  v.flexible("peak_n", f.peak_n, rule, kOptional, "instead: largest sample of each axis");
  rule.rule = positive("");
  describe_neutral(v, "rms", "rms_n", f.rms_n, rule);
  describe_neutral(v, "peak", "peak_n", f.peak_n, rule);
  group(
      v, "limits", describe_limits, f.config.limits, kOptional,
      "instead: as large as the limits allow, distributed for the smallest mean relative variance");
  const std::optional<LimitRequest>& limits = f.config.limits;
  const char* key = limits ? "limits" : is_set(f.rms_n) ? "rms_n" : "peak_n";
  v.require(
      int{is_set(f.rms_n)} + int{is_set(f.peak_n)} + int{limits.has_value()} == 1, key,
      "level: write exactly one of 'rms_n: NUMBER', 'peak_n: NUMBER' and 'limits: {prior: FILE}'");
  const std::size_t given = std::max(f.rms_n.numbers.size(), f.peak_n.numbers.size());
  v.require(given <= 1 || given == f.axes.size(), key,
            fmt::format("level: got {} numbers for {} axes; write one, or one per axis", given,
                        f.axes.size()));
}

void describe_lines(ConfigVisitor& v, ExperimentFile& f) {
  LineSpec& lines = f.config.lines;
  v.flexible("lines", f.lines,
             {.words = words_of<LineSelection>(), .list = true, .rule = {"", 1.0}}, kOptional,
             "which lines of the period are excited; a list: these multiples of 1 / period_s");
  if (const auto word = from_word<LineSelection>(f.lines.word)) lines.selection = *word;
  const std::vector<double>& listed = f.lines.numbers;
  v.require(std::ranges::adjacent_find(listed, std::ranges::greater_equal()) == listed.end() &&
                std::ranges::all_of(listed, [](double l) { return l == std::floor(l) && l < 1e8; }),
            "lines", "lines: must be increasing whole numbers, multiples of 1 / period_s");
  count(v, "group_size", lines.group_size, 2, 1000, kOptional,
        "odd_random: one odd line in this many is not excited");
  v.numbers("band_hz", f.band_hz, positive("Hz"), {2, 2}, kRequired,
            "lowest and highest frequency");
  v.require(f.band_hz.size() != 2 || f.band_hz[0] < f.band_hz[1], "band_hz",
            "band_hz: the band is empty; write [LOW, HIGH] with LOW < HIGH");
  v.flexible("shape", f.shape, {.words = {"flat"}, .pairs = true, .rule = positive("")}, kOptional,
             "amplitude spectrum: flat, or [frequency_hz, relative amplitude] points, log-log "
             "interpolation");
  const bool increasing =
      std::is_sorted(f.shape.pairs.begin(), f.shape.pairs.end(),
                     [](const auto& a, const auto& b) { return a.first <= b.first; });
  v.require(increasing, "shape", "shape: the frequencies must increase; sort the points");
}

void describe_phases(ConfigVisitor& v, decltype(ExperimentFile::phases)& phases) {
  auto& [axis, rad] = phases.emplace_back();
  v.text("axis", axis, kRequired, "name of an excited actuator");
  v.numbers("rad", rad, any_number("rad"), {1}, kRequired, "one phase per excited line");
}

void describe_experiment(ConfigVisitor& v, ExperimentFile& f) {
  ExperimentSpec& spec = f.config.experiment;
  v.texts("axes", f.axes, {1, 64}, kRequired, "names of the excited actuators");
  choose(v, "scheme", spec.scheme, kOptional, "distribution of the axes over the experiments");
  group(v, "level", describe_level, f, kRequired, "size of the excitation");
  describe_lines(v, f);
  v.number("period_s", f.period_s, positive("s"), kRequired, "period of the multisine");
  count(v, "transient_periods", spec.transient_periods, 0, 1000, kOptional,
        "unused periods before the measured ones");
  count(v, "periods", spec.periods, 1, 100000, kOptional, "measured periods per run");
  count(v, "realizations", spec.realizations, 1, 10000, kOptional,
        "number of realizations of the random phases");
  count(v, "crest_iterations", spec.crest_iterations, 0, 100000, kOptional,
        "iterations of the crest-factor reduction; 0: phases stay random");
  v.require(!f.config.limits || spec.crest_iterations > 0, "crest_iterations",
            "crest_iterations: 'limits' also optimizes the phases; write 20");
  v.require(!f.config.limits || f.shape.pairs.empty(), "shape",
            "shape: 'limits' designs the spectrum; remove 'shape'");
  items(v, "phases", describe_phases, f.phases, {0, 64}, kOptional,
        "phases of some axes in all realizations; omitted: random");
  for (const auto& phases : f.phases)
    v.require(
        std::ranges::count(f.axes, phases.first) == 1 &&
            std::ranges::count(f.phases, phases.first, &decltype(f.phases)::value_type::first) == 1,
        "phases",
        fmt::format("phases: '{}' is not an axis, or has phases twice; name each of 'axes' at "
                    "most once",
                    phases.first));
  v.require(!f.config.limits || f.phases.empty(), "phases",
            "phases: 'limits' designs the phases; remove 'phases'");
  v.require(!f.config.limits || spec.scheme != ExcitationScheme::simultaneous, "scheme",
            "scheme: 'limits' is for the measurement of a response, which 'simultaneous' does not "
            "determine; choose another scheme");
  count(v, "seed", spec.seed, 0, std::numeric_limits<std::int64_t>::max(), kOptional,
        "the same seed gives the same experiment on every machine");
}

void describe(ConfigVisitor& v, ExperimentFile& f) {
  v.choice("format", f.format, {"stageid-experiment"}, kRequired, "file type");
  v.text("stage", f.stage, kRequired, "stage file, relative to this one");
  group(v, "experiment", describe_experiment, f, kRequired, "the measurement");
  group(v, "frf", describe_frf_keys, f.config.frf, kOptional,
        "estimation of the frequency response");
  group(v, "fit", describe_fit_keys, f.config.fit, kOptional, "fit of the model");
  v.group(
      "validation",
      [&](ConfigVisitor& validation) {
        const int realizations = f.config.experiment.realizations;
        int realization = 0;
        count(validation, "realization", realization, 1, 10000, kRequired,
              "realization held back from the fit, counted from 1");
        validation.require(
            realization <= realizations, "realization",
            fmt::format("realization: {} is out of range, {} are measured; hold back one of these",
                        realization, realizations));
        validation.require(
            realizations > 1, "realization",
            "realization: no realization remains for the fit; set realizations to 2 or more");
        f.config.validation_realization = realization - 1;
      },
      kOptional, "validation; omitted: no realization is held back");
}

/// Relative amplitude at every line, log-log between the points, constant beyond them.
Eigen::VectorXd shape_on(const FrequencyGrid& grid,
                         const std::vector<std::pair<double, double>>& points) {
  if (points.empty()) return {};
  Eigen::VectorXd shape = grid.frequency_hz();
  for (double& value : shape) {
    const double f = value;
    const auto above = std::find_if(points.begin(), points.end(),
                                    [&](const auto& point) { return point.first >= f; });
    if (above == points.begin() || above == points.end()) {
      value = above == points.end() ? points.back().second : points.front().second;
      continue;
    }
    const auto& below = *(above - 1);
    const double t = std::log(f / below.first) / std::log(above->first / below.first);
    value = below.second * std::pow(above->second / below.second, t);
  }
  return shape;
}

/// Null if the file lacks the key.
const YamlNode* value_of(const YamlDocument& document, std::string_view section,
                         std::string_view key) {
  const YamlNode* node = document.value(document.root(), section);
  return node == nullptr ? nullptr : document.value(*node, key);
}

[[noreturn]] void fail(const YamlDocument& document, const char* key, const std::string& message) {
  const YamlNode* node = value_of(document, "experiment", key);
  document.fail(node == nullptr ? YamlMark{} : node->mark, message);
}

int samples_per_period(const YamlDocument& document, double period_s, double rate_hz) {
  const double samples = period_s * rate_hz;
  const double whole = std::round(samples);
  if (std::abs(samples - whole) > 1e-9 * samples || whole < 4.0 || whole > 1e8)
    fail(document, "period_s",
         fmt::format("period_s: {} s is {} samples at {} Hz; a period must be a whole number of "
                     "samples, 4 to 1e8",
                     period_s, samples, rate_hz));
  return static_cast<int>(whole);
}

void check_band(const YamlDocument& document, double high_hz, double rate_hz) {
  if (high_hz >= 0.5 * rate_hz)
    fail(document, "band_hz",
         fmt::format("band_hz: {} Hz is not below half the sample rate, {} Hz; lower it", high_hz,
                     0.5 * rate_hz));
}

std::vector<int> listed_lines(const ExperimentFile& file, const YamlDocument& document) {
  std::vector<int> lines;
  for (const double line : file.lines.numbers) {
    const double frequency_hz = line / file.period_s;
    if (frequency_hz < file.band_hz[0] * (1.0 - 1e-9) ||
        frequency_hz > file.band_hz[1] * (1.0 + 1e-9))
      fail(document, "lines",
           fmt::format("lines: {} is at {:.6g} Hz, outside band_hz; widen the band or remove it",
                       line, frequency_hz));
    lines.push_back(static_cast<int>(line));
  }
  return lines;
}

void check_names(const YamlDocument& document, const char* section, const char* key,
                 const std::vector<std::string>& names, const std::vector<Channel>& channels,
                 const char* kind, FormatErrorList& errors) {
  std::vector<std::string> known;
  for (const Channel& channel : channels) known.push_back(channel.name);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (channel_index(channels, names[i]) >= 0) continue;
    const YamlNode* list = value_of(document, section, key);
    const YamlMark mark = list == nullptr ? YamlMark{} : document.node(list->items.at(i)).mark;
    errors.attempt([&] {
      document.fail(mark, fmt::format("{}: unknown {} '{}'; {}", key, kind, names[i],
                                      suggest_key(names[i], known)));
    });
  }
}

std::vector<ExcitationAxis> excitation_axes(const ExperimentFile& file, const FrequencyGrid& grid) {
  const std::vector<double> designed = {1.0};
  const std::vector<double>& levels = file.config.limits   ? designed
                                      : is_set(file.rms_n) ? file.rms_n.numbers
                                                           : file.peak_n.numbers;
  const Eigen::VectorXd shape = shape_on(grid, file.shape.pairs);
  std::vector<ExcitationAxis> axes;
  for (std::size_t i = 0; i < file.axes.size(); ++i)
    axes.push_back({file.axes[i], levels.size() == 1 ? levels.front() : levels[i], shape, {}});
  for (const auto& [name, rad] : file.phases)
    for (ExcitationAxis& axis : axes)
      if (axis.channel == name)
        axis.phase_rad = Eigen::Map<const Eigen::VectorXd>(rad.data(), std::ssize(rad));
  return axes;
}

/// Rejects a plan before the measurement that `frf` could not evaluate.
void require_zippered_lines(const ExperimentSpec& spec, const FrequencyGrid& grid) {
  const auto n = static_cast<Eigen::Index>(spec.axes.size());
  if (spec.scheme != ExcitationScheme::zippered || n < 2) return;
  ZipperedLines lines{grid.lines(), {}, n};
  for (Eigen::Index k = 0; k < grid.size(); ++k)
    for (Eigen::Index p = 0; p < n; ++p)
      if (has_line(spec.scheme, p, n, k)) lines.axis.push_back(p);
  std::vector<std::string> names;
  for (const ExcitationAxis& axis : spec.axes) names.push_back(axis.channel);
  require_enough_lines(lines, names, "experiment");
}

/// Fingerprint of the numbers and the stage that determine the measurement, not of the later use of the data.
std::string measurement_id(const ExperimentFile& f) {
  const ExperimentSpec& s = f.config.experiment;
  const LineSpec& lines = f.config.lines;
  const std::optional<LimitRequest>& limits = f.config.limits;
  std::string text = fmt::format(
      "scheme {} scaling {} lines {} group {} period {} transient {} periods {} realizations {} "
      "crest {} seed {} band {} {}",
      static_cast<int>(s.scheme), static_cast<int>(s.scaling), static_cast<int>(lines.selection),
      lines.group_size, f.period_s, s.transient_periods, s.periods, s.realizations,
      s.crest_iterations, s.seed, lines.low_hz, lines.high_hz);
  for (const ExcitationAxis& axis : s.axes)
    text += fmt::format(" axis {} {}", axis.channel, axis.level);
  if (limits)
    text += fmt::format(" limits {} {} {}", limits->safety, limits->velocity_m_s,
                        std::filesystem::exists(limits->prior) ? fingerprint_of_file(limits->prior)
                                                               : "not there yet");
  for (const auto& [axis, rad] : f.phases)
    text += fmt::format(" phases {} {}", axis, fmt::join(rad, " "));
  for (const int line : f.config.listed_lines) text += fmt::format(" line {}", line);
  for (const auto& [frequency_hz, amplitude] : f.shape.pairs)
    text += fmt::format(" shape {} {}", frequency_hz, amplitude);
  return fingerprint_of(text + "\n" + f.config.stage.text + f.config.stage.controller_text);
}

void complete(ExperimentFile& file, const YamlDocument& document) {
  ExperimentConfig& config = file.config;
  const StageInfo& info = config.stage.spec.info;
  FormatErrorList errors;
  check_names(document, "experiment", "axes", file.axes, info.actuators, "actuator", errors);
  check_names(document, "frf", "inputs", config.frf.inputs, info.actuators, "actuator", errors);
  check_names(document, "frf", "outputs", config.frf.outputs, info.sensors, "sensor", errors);
  errors.attempt([&] { check_band(document, file.band_hz[1], info.sample_rate_hz); });
  errors.attempt([&] {
    config.samples_per_period = samples_per_period(document, file.period_s, info.sample_rate_hz);
  });
  errors.attempt([&] { config.listed_lines = listed_lines(file, document); });
  errors.raise();
  config.lines.low_hz = file.band_hz[0];
  config.lines.high_hz = file.band_hz[1];
  config.lines.seed = config.experiment.seed;
  config.experiment.scaling = is_set(file.peak_n) ? AmplitudeScaling::peak : AmplitudeScaling::rms;
  // Errors of the excitation library get the position of the corresponding section.
  try {
    const FrequencyGrid grid = grid_of(config);
    config.experiment.axes = excitation_axes(file, grid);
    outline_plan(config);
    require_zippered_lines(config.experiment, grid);
  } catch (const std::invalid_argument& error) {
    fail(document, "band_hz", error.what());
  }
  config.measurement_id = measurement_id(file);
}

std::filesystem::path stage_file_of(const std::filesystem::path& path, const YamlDocument& document,
                                    const std::string& stage) {
  std::filesystem::path file = (path.parent_path() / stage).lexically_normal();
  if (std::filesystem::exists(file)) return file;
  if (const YamlNode* value = document.value(document.root(), "stage"))
    document.fail(
        value->mark,
        fmt::format("stage: no such file: {}; write the path of a stage file, relative to this one",
                    file.string()));
  return file;
}

}  // namespace

void describe_frf_keys(ConfigVisitor& v, FrfOptions& f) {
  v.texts("inputs", f.inputs, {1}, kOptional,
          "actuators of the response; omitted: the excited ones");
  v.texts("outputs", f.outputs, {1}, kOptional, "sensors of the response; omitted: all");
  choose(v, "covariance", f.covariance, kOptional,
         "diagonal: variances; full: also the covariances between channels");
  choose(
      v, "method", f.method, kOptional,
      "periodic: means over periods; lpm: local polynomial method, which models the transient in "
      "whole records");
  choose(v, "periods", f.periods, kOptional,
         "consistent: replace short glitches, discard periods with bumps or transients (lpm: "
         "discard periods with glitches); "
         "unmarked: use all periods without marked samples");
  count(v, "smooth_covariance", f.covariance_lines, 1, 9999, kOptional,
        "odd number of neighbouring lines over which the noise covariance is averaged");
  v.require(
      f.covariance_lines % 2 == 1, "smooth_covariance",
      "smooth_covariance: must be odd: the line and the same number of neighbours on both sides");
}

void describe_experiment_keys(ConfigVisitor& visitor) {
  ExperimentFile file;
  describe(visitor, file);
}

ExperimentConfig load_experiment_config(const std::filesystem::path& path) {
  const YamlDocument document = YamlDocument::read(path);
  ExperimentFile file;
  ExperimentConfig& config = file.config;
  config.file = path;
  config.text = document.text();
  FormatErrorList errors;
  errors.attempt(
      [&] { read_config(document, [&](ConfigVisitor& visitor) { describe(visitor, file); }); });
  if (!file.stage.empty())
    errors.attempt(
        [&] { config.stage = load_stage_config(stage_file_of(path, document, file.stage)); });
  errors.raise();
  if (config.limits)
    config.limits->prior = (path.parent_path() / config.limits->prior).lexically_normal();
  complete(file, document);
  return std::move(file.config);
}

}  // namespace stageid

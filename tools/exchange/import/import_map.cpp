#include "tools/exchange/import/import_map.hpp"

#include <algorithm>
#include <iterator>
#include <set>
#include <sstream>

#include "acquisition/files/counted.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {
namespace {

void describe_channel(ConfigVisitor& v, ImportMap::Channel& channel) {
  v.text("output", channel.output, kRequired, "name of the output");
  v.text("input", channel.input, kRequired, "name of the input");
  v.text("response", channel.response, kOptional, "array of complex numbers");
  v.text("real", channel.real, kOptional, "or array of real parts");
  v.text("imaginary", channel.imaginary, kOptional, "and array of imaginary parts");
  v.text("magnitude", channel.magnitude, kOptional, "or array of magnitudes");
  v.text("phase_deg", channel.phase_deg, kOptional, "and array of phases in degrees");
  v.text("noise_variance", channel.noise_variance, kOptional, "array, in every channel or in none");
  v.text("total_variance", channel.total_variance, kOptional, "array, in every channel or in none");
  const int forms = static_cast<int>(!channel.response.empty()) +
                    static_cast<int>(!channel.real.empty()) +
                    static_cast<int>(!channel.magnitude.empty());
  v.require(
      forms == 1 && channel.real.empty() == channel.imaginary.empty() &&
          channel.magnitude.empty() == channel.phase_deg.empty(),
      "output",
      "a channel needs exactly one of: response; real and imaginary; magnitude and phase_deg");
}

void describe_signals(ConfigVisitor& v, ImportMap::Signals& signals) {
  v.texts("arrays", signals.arrays, {1}, kRequired, "arrays of samples, or of samples x channels");
  v.texts("names", signals.names, {1}, kOptional,
          "names of the channels; omitted: those of the arrays");
  v.texts("axes", signals.axes, {1, 5}, kOptional,
          "axes of the arrays in their order: sample, channel, realization, experiment, run");
  static const std::set<std::string> kAxes = {"sample", "channel", "realization", "experiment",
                                              "run"};
  const std::set<std::string> axes(signals.axes.begin(), signals.axes.end());
  v.require(axes.size() == signals.axes.size() && (axes.empty() || axes.contains("sample")) &&
                std::includes(kAxes.begin(), kAxes.end(), axes.begin(), axes.end()) &&
                !(axes.contains("run") && axes.contains("realization")) &&
                !(axes.contains("run") && axes.contains("experiment")),
            "arrays",
            "axes must contain sample, and at most once each of channel, realization and "
            "experiment or run; write for example axes: [sample, channel, run]");
  v.text("unit", signals.unit, kOptional, "one, or one per channel separated by blanks");
  v.numbers("scale", signals.scale, {}, {1}, kOptional,
            "physical unit per number in the file, one per channel");
}

void describe_run(ConfigVisitor& v, ImportMap::Run& run) {
  constexpr std::int64_t kMost = std::int64_t{1} << 48;
  v.integer("realization", run.realization, 0, 1'000'000, kOptional, "0-based");
  v.integer("experiment", run.experiment, 0, 1'000'000, kOptional, "0-based");
  v.integer("first_row", run.first_row, 0, kMost, kOptional, "0-based");
  v.integer("rows", run.rows, 0, kMost, kOptional, "0: to the end");
}

/// Rejects a run that is a duplicate of an earlier one: one run would have two contents.
void require_another_run(ConfigVisitor& v, const std::vector<ImportMap::Run>& runs) {
  const ImportMap::Run& last = runs.back();
  const auto same = std::ranges::find_if(runs, [&](const ImportMap::Run& run) {
    return run.realization == last.realization && run.experiment == last.experiment;
  });
  const auto place = same - runs.begin();
  const bool another = place + 1 == std::ssize(runs);
  v.require(another, "experiment",
            fmt::format("entries {} and {} of runs are both realization: {}, experiment: {}; make "
                        "each run unique",
                        place + 1, runs.size(), last.realization, last.experiment));
}

void describe_scalar(ConfigVisitor& v, const char* key, ImportMap::Scalar& scalar,
                     const char* help) {
  FlexibleValue value = {scalar.variable};
  v.flexible(key, value,
             {.any_text = true,
              .text_meaning = "the name of a variable",
              .number = true,
              .rule = not_negative("Hz")},
             kOptional, help);
  scalar.variable = value.word;
  if (!value.numbers.empty()) scalar.number = value.numbers.front();
}

void describe_frf(ConfigVisitor& v, ImportMap& map) {
  v.text("frequency", map.frequency, kOptional, "array of frequencies");
  describe_scalar(v, "first_hz", map.first_hz,
                  "first frequency of an equidistant axis, or the variable that contains it");
  describe_scalar(v, "step_hz", map.step_hz, "frequency step, or the variable that contains it");
  choose(v, "frequency_unit", map.frequency_unit, kOptional, "unit of the frequencies");
  v.text("response", map.response, kOptional, "array of the response, complex or its real part");
  v.text("response_imaginary", map.response_imaginary, kOptional, "array of its imaginary part");
  v.texts("axes", map.axes, {3, 3}, kOptional,
          "axes of the response: line, output, input in their order");
  v.text("noise_variance", map.noise_variance, kOptional, "array, axes as the response");
  v.text("total_variance", map.total_variance, kOptional, "array, axes as the response");
  v.texts("inputs", map.inputs, {1}, kOptional, "names");
  v.texts("outputs", map.outputs, {1}, kOptional, "names");
  v.text("input_unit", map.input_unit, kOptional, "one, or one per input separated by blanks");
  v.text("output_unit", map.output_unit, kOptional, "one, or one per output separated by blanks");
  choose(v, "hold", map.hold, kOptional,
         "zoh: measured through a zero-order hold, as in a digital loop");
  v.items(
      "channels",
      [&map](ConfigVisitor& item) { describe_channel(item, map.channels.emplace_back()); }, {1},
      kOptional, "the response, channel by channel");
}

void describe_log(ConfigVisitor& v, ImportMap& map) {
  v.integer("period_samples", map.period_samples, 0, 1 << 27, kOptional, "samples of one period");
  v.integer("transient_periods", map.transient_periods, 0, 1'000'000, kOptional,
            "unused periods at the start of every run");
  group(v, "excitation", describe_signals, map.excitation, kOptional, "signals added in the loop");
  group(v, "actuators", describe_signals, map.actuators, kOptional, "inputs of the plant");
  group(v, "sensors", describe_signals, map.sensors, kOptional, "outputs of the plant");
  choose(v, "excitation_period", map.excitation_period, kOptional,
         "mean: the excitation was measured; use the mean of its periods after the transient");
  v.items(
      "runs",
      [&map](ConfigVisitor& item) {
        describe_run(item, map.runs.emplace_back());
        require_another_run(item, map.runs);
      },
      {1}, kOptional, "omitted: one run with all rows");
}

void require_keys(ConfigVisitor& v, const ImportMap& map) {
  if (map.kind == ImportMap::Kind::log) {
    v.require(map.period_samples > 0, "kind", "a log needs period_samples; add the key");
    for (const auto& [key, group] : map.groups())
      v.require(!group->arrays.empty(), "kind",
                fmt::format("a log needs {}: {{arrays: [...]}}; add it", key));
    return;
  }
  const bool even = !map.first_hz.empty() || !map.step_hz.empty();
  v.require(map.frequency.empty() == even, "kind",
            map.frequency.empty()
                ? "a frequency response needs frequency, or first_hz and step_hz; add it"
                : "a frequency response cannot have both frequency and first_hz with step_hz; "
                  "remove one");
  v.require(!even || (!map.first_hz.empty() && !map.step_hz.empty()), "kind",
            "first_hz and step_hz are only valid together; add the missing key");
  v.require(!even || map.frequency_unit == ImportMap::FrequencyUnit::hz, "kind",
            "first_hz and step_hz are in Hz; remove frequency_unit");
  v.require(map.response.empty() != map.channels.empty(), "kind",
            "a frequency response needs either response or channels; add one of them");
  for (const auto name : {&ImportMap::Channel::noise_variance, &ImportMap::Channel::total_variance})
    v.require(std::ranges::all_of(map.channels,
                                  [&](const ImportMap::Channel& channel) {
                                    return (channel.*name).empty() ==
                                           (map.channels.front().*name).empty();
                                  }),
              "channels",
              "a variance must be given for all channels or for none; add or remove it");
}

}  // namespace

std::vector<std::string> units_of(const ImportMap& map, const char* key, const std::string& words,
                                  std::size_t count) {
  std::istringstream stream(words);
  std::vector<std::string> units{std::istream_iterator<std::string>(stream), {}};
  if (units.empty()) units = {"1"};
  if (units.size() == 1) units.resize(count, units.front());
  if (units.size() != count)
    refuse_map(map, "{}: got {} for {}; write one, or one per channel", key,
               counted(units.size(), "unit"), counted(count, "channel"));
  return units;
}

ImportMap read_import_map(const std::filesystem::path& file) {
  ImportMap map;
  map.file = file;
  const YamlDocument document = YamlDocument::read(file);
  read_config(document, [&map](ConfigVisitor& v) {
    choose(v, "kind", map.kind, kRequired, "content of the file");
    v.text("files", map.files, kOptional,
           "pattern of the files of a log, such as run_{realization}_{experiment}.mat, relative to "
           "this map");
    v.number("sample_rate_hz", map.sample_rate_hz, {"Hz", 0.0}, kOptional,
             "0: unknown; a log uses that of the file");
    choose(v, "file_sample_rate", map.file_sample_rate, kOptional,
           "ignored: the file's own sample rate or time axis is known to be wrong");
    describe_frf(v, map);
    describe_log(v, map);
    require_keys(v, map);
  });
  return map;
}

}  // namespace stageid

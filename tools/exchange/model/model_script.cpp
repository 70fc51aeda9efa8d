#include "tools/exchange/model/model_script.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cctype>
#include <cmath>
#include <vector>

#include "acquisition/files/version.hpp"
#include "estimation/modal/sampled_state_space.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/text_template.hpp"

namespace stageid {

// From the files of these names.
extern const std::string_view model_script_m;
extern const std::string_view model_script_py;

namespace {

/// Syntax that differs between the two languages.
class Syntax {
 public:
  explicit Syntax(ScriptLanguage language) : python_(language == ScriptLanguage::python) {}

  std::string number(double value) const {
    if (std::isnan(value)) return python_ ? "np.nan" : "NaN";
    if (std::isinf(value))
      return fmt::format("{}{}", value < 0 ? "-" : "", python_ ? "np.inf" : "Inf");
    return fmt::format("{}", value);
  }

  std::string text(const std::string& value) const {
    if (python_) return in_ascii(SortedJson(value));
    std::string quoted = "'";
    bool joined = false;  // a line break would end the text, and begin a command
    for (const char c : value) {
      const bool control = static_cast<unsigned char>(c) < ' ';
      joined = joined || control;
      if (control)
        quoted += fmt::format("', char({}), '", static_cast<int>(c));
      else
        quoted.append(c == '\'' ? 2 : 1, c);
    }
    return joined ? fmt::format("[{}']", quoted) : quoted + "'";
  }

  std::string texts(const std::vector<std::string>& values) const {
    std::vector<std::string> quoted;
    for (const std::string& value : values) quoted.push_back(text(value));
    return fmt::format(fmt::runtime(python_ ? "[{}]" : "{{{}}}"), fmt::join(quoted, ", "));
  }

  std::string matrix(const Eigen::MatrixXd& m) const {
    if (m.size() == 0)
      return python_ ? fmt::format("np.zeros(({}, {}))", m.rows(), m.cols())
                     : fmt::format("zeros({}, {})", m.rows(), m.cols());
    std::string rows;
    for (const auto& row : m.rowwise())
      rows += fmt::format(fmt::runtime(python_ ? "    [{}],\n" : "  {};\n"), numbers(row));
    return python_ ? fmt::format("np.array([\n{}])", rows) : fmt::format("[ ...\n{}]", rows);
  }

  /// A one-dimensional array; a column in MATLAB.
  template <typename Vector>
  std::string vector(const Vector& v) const {
    return fmt::format(fmt::runtime(python_ ? "np.array([{}])" : "[{}].'"), numbers(v));
  }

  std::string assign(const std::string& name, const std::string& value) const {
    if (python_) return fmt::format("{} = {}\n", name, value);
    std::string field = name;
    for (char& c : field) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return fmt::format("model.{} = {};\n", name.size() <= 2 ? name : field, value);
  }

 private:
  template <typename Numbers>
  std::string numbers(const Numbers& values) const {
    std::vector<std::string> list;
    for (const double value : values) list.push_back(number(value));
    return fmt::format("{}", fmt::join(list, ", "));
  }

  bool python_;
};

void add_system(const Syntax& syntax, const StateSpace& system, const std::string& suffix,
                std::string& text) {
  text += syntax.assign("A" + suffix, syntax.matrix(system.A));
  text += syntax.assign("B" + suffix, syntax.matrix(system.B));
  text += syntax.assign("C" + suffix, syntax.matrix(system.C));
  text += syntax.assign("D" + suffix, syntax.matrix(system.D));
}

/// For the uncertain model: deviations of the modes (NaN: unknown), and rows [mode, first state of a pair], from 1.
std::string uncertain_modes(const AdditiveModel& model, const Syntax& syntax) {
  std::vector<double> frequency_std_hz, damping_std;
  std::vector<Eigen::RowVector2d> pairs;
  const StateSpace system = state_space(model);
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& s = model.submodels[i];
    if (!s.is_mode()) continue;
    frequency_std_hz.push_back(s.natural_frequency_std_hz.value_or(std::nan("")));
    damping_std.push_back(s.damping_ratio_std.value_or(std::nan("")));
    for (const StateBlock& block : system.blocks)
      if (block.submodel == static_cast<long long>(i) && block.size == 2)
        pairs.emplace_back(static_cast<double>(damping_std.size()),
                           static_cast<double>(block.first) + 1.0);
  }
  Eigen::MatrixXd states(std::ssize(pairs), 2);
  for (Eigen::Index row = 0; row < states.rows(); ++row) states.row(row) = pairs[row];
  return syntax.assign("NATURAL_FREQUENCY_STD_HZ", syntax.vector(frequency_std_hz)) +
         syntax.assign("DAMPING_RATIO_STD", syntax.vector(damping_std)) +
         syntax.assign("MODE_STATES", syntax.matrix(states));
}

std::string model_data(const AdditiveModel& model, const Syntax& syntax) {
  std::string text;
  text += syntax.assign("INPUTS", syntax.texts(model.inputs.names));
  text += syntax.assign("INPUT_UNITS", syntax.texts(model.inputs.units));
  text += syntax.assign("OUTPUTS", syntax.texts(model.outputs.names));
  text += syntax.assign("OUTPUT_UNITS", syntax.texts(model.outputs.units));
  text += syntax.assign("SAMPLE_RATE_HZ", syntax.number(model.sample_rate_hz));
  text += syntax.assign("HOLD", syntax.text(to_string(model.hold)));
  text += syntax.assign("BAND_HZ", syntax.vector(model.fit.band_hz));
  std::vector<double> frequency_hz, damping;
  for (const Submodel& s : model.submodels)
    if (s.is_mode()) {
      frequency_hz.push_back(s.natural_frequency_hz());
      damping.push_back(s.damping_ratio());
    }
  text += syntax.assign("NATURAL_FREQUENCY_HZ", syntax.vector(frequency_hz));
  text += syntax.assign("DAMPING_RATIO", syntax.vector(damping));
  text += syntax.assign("INPUT_DELAY_S", syntax.vector(model.input_delays_s()));
  text += syntax.assign("OUTPUT_DELAY_S", syntax.vector(model.output_delays_s()));
  add_system(syntax, state_space(model), "", text);
  if (!(model.sample_rate_hz > 0.0)) return text;
  const SampledStateSpace sampled = sampled_state_space(model);
  text += syntax.assign("INPUT_DELAY_SAMPLES",
                        syntax.vector(sampled.input_delay_samples.cast<double>()));
  text += syntax.assign("OUTPUT_DELAY_SAMPLES",
                        syntax.vector(sampled.output_delay_samples.cast<double>()));
  add_system(syntax, sampled.system, "d", text);
  return text;
}

}  // namespace

std::string model_script(const AdditiveModel& model, ScriptLanguage language,
                         const std::string& function) {
  const Syntax syntax(language);
  const bool python = language == ScriptLanguage::python;
  const auto text = [](auto value) { return fmt::format("{}", value); };
  return fill_template(
      python ? model_script_py : model_script_m,
      {{"function", function},
       {"outputs", text(model.n_outputs())},
       {"inputs", text(model.n_inputs())},
       {"version", version()},
       {"data", model_data(model, syntax) + (python ? "" : uncertain_modes(model, syntax))}});
}

}  // namespace stageid

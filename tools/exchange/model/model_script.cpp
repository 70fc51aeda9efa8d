#include "tools/exchange/model/model_script.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "acquisition/files/version.hpp"
#include "estimation/modal/sampled_state_space.hpp"

namespace stageid {
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
    if (python_)
      return nlohmann::json(value).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
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

constexpr const char* kPythonHead = R"(#!/usr/bin/env python3
"""A model of {} outputs and {} inputs, written by stageid {}.

Continuous: x' = A x + B u, y = C x + D u, input j delayed by INPUT_DELAY_S[j] and output i by
OUTPUT_DELAY_S[i]. Sampled, if the sample rate is known: Ad, Bd, Cd, Dd behind a zero-order hold, with
whole samples of delay. response(f) is [N x outputs x inputs] as the model's hold has it. SI units.
"""
import numpy as np

)";

constexpr const char* kPythonTail = R"(

def _response(p, a, b, c, d, input_delay, output_delay):
    """C (p I - A)^-1 B + D at every p, with the factors of the delays, [N x n_y] and [N x n_u]."""
    core = np.array([c @ np.linalg.solve(value * np.eye(len(a)) - a, b) + d for value in p])
    return core * output_delay[:, :, None] * input_delay[:, None, :]


def continuous_response(frequency_hz):
    """[N x n_y x n_u] of the continuous model, with its delays, without a hold."""
    s = 2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, float))
    return _response(s, A, B, C, D, np.exp(-np.outer(s, INPUT_DELAY_S)),
                     np.exp(-np.outer(s, OUTPUT_DELAY_S)))


def sampled_response(frequency_hz):
    """[N x n_y x n_u] of the model behind a zero-order hold, sampled."""
    z = np.exp(2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, float)) / SAMPLE_RATE_HZ)
    return _response(z, Ad, Bd, Cd, Dd, z[:, None] ** -INPUT_DELAY_SAMPLES,
                     z[:, None] ** -OUTPUT_DELAY_SAMPLES)


def response(frequency_hz):
    """[N x n_y x n_u] through the model's hold: "none", "phase", "sinc" or "exact"."""
    if HOLD == "exact":
        return sampled_response(frequency_hz)
    result = continuous_response(frequency_hz)
    if HOLD != "none":
        turns = np.atleast_1d(np.asarray(frequency_hz, float)) / SAMPLE_RATE_HZ
        result *= np.exp(-1j * np.pi * turns)[:, None, None]
        if HOLD == "sinc":
            result *= np.sinc(turns)[:, None, None]
    return result


def main():
    try:
        import matplotlib.pyplot as plt
    except ImportError:
        raise SystemExit(f"{__file__}: the plot needs matplotlib; install python3-matplotlib, "
                         "or import this file and call its response") from None

    low, high = BAND_HZ if BAND_HZ[1] > BAND_HZ[0] > 0 else (1.0, 1000.0)
    f = np.geomspace(low, high, 2000)
    p = np.abs(response(f))
    figure, axes = plt.subplots(len(OUTPUTS), len(INPUTS), sharex=True, squeeze=False)
    for i, output in enumerate(OUTPUTS):
        for j, name in enumerate(INPUTS):
            axes[i, j].loglog(f, p[:, i, j])
            axes[i, j].set_title(f"{output} <- {name} [{OUTPUT_UNITS[i]}/{INPUT_UNITS[j]}]", fontsize="small")
    figure.supxlabel("frequency [Hz]")
    plt.show()


if __name__ == "__main__":
    main()
)";

constexpr const char* kMatlabHead = R"(function model = {3}()
% A model of {0} outputs and {1} inputs, written by stageid {2}.
%
% Continuous: x' = A x + B u, y = C x + D u, input j delayed by input_delay_s(j) and output i by
% output_delay_s(i). Sampled, if the sample rate is known: Ad, Bd, Cd, Dd behind a zero-order hold,
% with whole samples of delay. model.response(f) is outputs x inputs x length(f) as the model's hold
% has it. SI units. Without an output argument it is plotted. With the toolboxes of MATLAB:
%   Control System         model.continuous and model.sampled, ss with delays
%   System Identification  model.identified, idss, and model.frd, idfrd on 1000 lines of the band
%   Robust Control         model.uncertain, uss: natural frequencies and damping ratios +- 1.96 standard deviations
)";

constexpr const char* kMatlabTail = R"(
model.continuous_response = @(f) continuous_response(model, f);
model.response = @(f) held_response(model, f);
if exist('absorbDelay', 'file') % not in Octave
  try
    model = add_toolbox_models(model);
  catch problem % the numbers are there without it
    warning('stageid:toolbox', 'no models of the toolboxes: %s', problem.message);
  end
end
if nargout == 0
  plot_model(model);
  clear model
end
end

function model = add_toolbox_models(model)
names = {'InputName', model.inputs, 'OutputName', model.outputs};
delays = {'InputDelay', model.input_delay_s, 'OutputDelay', model.output_delay_s};
model.continuous = ss(model.A, model.B, model.C, model.D, delays{:}, names{:});
if exist('uss', 'file')
  model.uncertain = ss(uncertain_transition(model), model.B, model.C, model.D, delays{:}, names{:});
end
if model.sample_rate_hz > 0
  Ts = 1 / model.sample_rate_hz;
  model.sampled = ss(model.Ad, model.Bd, model.Cd, model.Dd, Ts, 'InputDelay', ...
    model.input_delay_samples, 'OutputDelay', model.output_delay_samples, names{:});
  if exist('idss', 'file')
    model.identified = idss(absorbDelay(model.sampled)); % its outputs cannot have delays
  end
end
if exist('idfrd', 'file') && model.band_hz(2) > model.band_hz(1)
  f = linspace(model.band_hz(1), model.band_hz(2), 1000).';
  Ts = 0;
  if ~strcmp(model.hold, 'none')
    Ts = 1 / model.sample_rate_hz;
  end
  model.frd = idfrd(model.response(f), 2 * pi * f, Ts, names{:});
end
end

function A = uncertain_transition(model)
% A with the pair of poles of every mode whose deviations are known as w [-zeta, -c; c, -zeta], c = sqrt(1 - zeta^2).
A = umat(model.A);
for k = 1:numel(model.natural_frequency_hz)
  df = 1.96 * model.natural_frequency_std_hz(k);
  dz = 1.96 * model.damping_ratio_std(k);
  if ~(df > 0 && dz > 0)
    continue
  end
  w = 2 * pi * ureal(sprintf('f%d', k), model.natural_frequency_hz(k), 'PlusMinus', df);
  z = ureal(sprintf('zeta%d', k), model.damping_ratio(k), 'PlusMinus', dz);
  c = sqrt(1 - model.damping_ratio(k)^2);
  for i = model.mode_states(model.mode_states(:, 1) == k, 2).'
    A(i:i+1, i:i+1) = w * [-z, -c; c, -z];
  end
end
end

function P = state_space_response(p, A, B, C, D, input_delay, output_delay)
% C (p I - A)^-1 B + D at every p, with the factors of the delays, n_u x N and n_y x N.
P = zeros(size(C, 1), size(B, 2), numel(p));
for k = 1:numel(p)
  P(:, :, k) = (output_delay(:, k) * input_delay(:, k).') .* (C * ((p(k) * eye(size(A)) - A) \ B) + D);
end
end

function P = continuous_response(model, f)
s = 2i * pi * f(:).';
P = state_space_response(s, model.A, model.B, model.C, model.D, exp(-model.input_delay_s * s), ...
  exp(-model.output_delay_s * s));
end

function P = held_response(model, f)
if strcmp(model.hold, 'exact')
  a = 2i * pi * f(:).' / model.sample_rate_hz;
  P = state_space_response(exp(a), model.Ad, model.Bd, model.Cd, model.Dd, ...
    exp(-model.input_delay_samples * a), exp(-model.output_delay_samples * a));
  return
end
P = continuous_response(model, f);
if strcmp(model.hold, 'none')
  return
end
turns = f(:).' / model.sample_rate_hz;
factor = exp(-1i * pi * turns);
if strcmp(model.hold, 'sinc')
  held = turns ~= 0;
  factor(held) = factor(held) .* sin(pi * turns(held)) ./ (pi * turns(held));
end
P = P .* reshape(factor, 1, 1, []);
end

function plot_model(model)
band = model.band_hz;
if ~(band(2) > band(1) && band(1) > 0)
  band = [1; 1000];
end
f = logspace(log10(band(1)), log10(band(2)), 2000);
P = model.response(f);
[n_y, n_u, ~] = size(P);
for i = 1:n_y
  for j = 1:n_u
    subplot(n_y, n_u, (i - 1) * n_u + j);
    loglog(f, squeeze(abs(P(i, j, :))));
    title([model.outputs{i} ' <- ' model.inputs{j}], 'interpreter', 'none');
  end
end
end
)";

}  // namespace

std::string model_script(const AdditiveModel& model, ScriptLanguage language,
                         const std::string& function) {
  const Syntax syntax(language);
  const bool python = language == ScriptLanguage::python;
  const std::string head = fmt::format(fmt::runtime(python ? kPythonHead : kMatlabHead),
                                       model.n_outputs(), model.n_inputs(), version(), function);
  return head + model_data(model, syntax) +
         (python ? kPythonTail : uncertain_modes(model, syntax) + kMatlabTail);
}

}  // namespace stageid

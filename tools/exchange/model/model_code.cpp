#include "tools/exchange/model/model_code.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <stdexcept>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/version.hpp"
#include "estimation/modal/sampled_state_space.hpp"

namespace stageid {
namespace {

/// A name in a comment of the code: what would end or continue the comment is replaced.
std::string comment_text(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += static_cast<unsigned char>(c) < ' ' || c == '*' || c == '\\' ? '_' : c;
  return out;
}

std::string channel_comment(const ChannelList& channels) {
  std::string out;
  for (std::size_t i = 0; i < channels.size(); ++i)
    out += fmt::format(" *   [{}] {} [{}]\n", i, comment_text(channels.names[i]),
                       i < channels.units.size() ? comment_text(channels.units[i]) : "");
  return out;
}

/// Hexadecimal digits are exact in every C library.
std::string number(double value) { return fmt::format("{:a}", value); }

std::string table(const std::string& name, const char* what, const Eigen::MatrixXd& m) {
  std::string rows;
  for (const auto& row : m.rowwise()) {
    std::vector<std::string> entries;
    for (const double value : row) entries.push_back(number(value));
    rows += fmt::format("  {{{}}},\n", fmt::join(entries, ", "));
  }
  return fmt::format("static const double {}_{}[{}][{}] = {{\n{}}};\n", name, what, m.rows(),
                     m.cols(), rows);
}

template <typename Values>
std::string integers(const std::string& name, const char* what, const Values& values) {
  return fmt::format("static const int {}_{}[{}] = {{{}}};\n", name, what, values.size(),
                     fmt::join(std::vector<long long>(values.begin(), values.end()), ", "));
}

/// The blocks on the diagonal of A: every row has one or two entries.
std::string transition(const std::string& name, const StateSpace& system) {
  const Eigen::Index n = std::max<Eigen::Index>(system.order(), 1);  // C has no empty arrays
  Eigen::MatrixXd pairs = Eigen::MatrixXd::Zero(n, 2);
  std::vector<long long> first(n);
  for (const StateBlock& block : system.blocks)
    for (Eigen::Index i = 0; i < block.size; ++i) {
      // A single state is the first entry of a pair that begins with it, or ends with it at the end of the state.
      const Eigen::Index start = std::min(block.first, std::max<Eigen::Index>(n - 2, 0));
      first[block.first + i] = start;
      for (Eigen::Index j = 0; j < block.size; ++j)
        pairs(block.first + i, block.first + j - start) =
            system.A(block.first + i, block.first + j);
    }
  return table(name, "a", pairs) + integers(name, "a_first", first);
}

constexpr const char* kHead =
    R"(/* A sampled model of {outputs} outputs and {inputs} inputs, written by stageid {version}.
 *
 * x[n+1] = A x[n] + B v[n],  y_i[n + output_delay_i] = C_i x[n] + D_i v[n],  v_j[n] = u_j[n - input_delay_j],
 * at {rate} Hz, behind a zero-order hold. SI units. C99 and C++17; allocates nothing.
 * Inputs u:
{input_list} * Outputs y:
{output_list} */
#ifndef STAGEID_MODEL_{NAME}
#define STAGEID_MODEL_{NAME}

enum {{ {name}_inputs = {inputs}, {name}_outputs = {outputs}, {name}_states = {states} }};

typedef struct {{
  double x[{x_size}];
  double u[{name}_inputs][{u_delay}]; /* the latest inputs, a ring */
  double y[{name}_outputs][{y_delay}]; /* the outputs to come, a ring */
  int u_at;
  int y_at;
}} {name}_state;

#define {name}_sample_rate_hz {rate_hex}
)";

constexpr const char* kTail = R"(
static inline void {name}_reset({name}_state *state) {{
  static const {name}_state zero = {{{{0.0}}, {{{{0.0}}}}, {{{{0.0}}}}, 0, 0}};
  *state = zero;
}}

/* One sample: reads u[{name}_inputs], writes y[{name}_outputs]. */
static inline void {name}_step({name}_state *state, const double *u, double *y) {{
  double v[{name}_inputs];
  double next[{x_size}];
  state->u_at = (state->u_at + 1) % {u_delay};
  for (int j = 0; j < {name}_inputs; ++j) {{
    state->u[j][state->u_at] = u[j];
    v[j] = state->u[j][(state->u_at + {u_delay} - {name}_input_delay[j]) % {u_delay}];
  }}
  state->y_at = (state->y_at + 1) % {y_delay};
  for (int i = 0; i < {name}_outputs; ++i) {{
    double sum = 0.0;
    for (int k = 0; k < {name}_states; ++k) sum += {name}_c[i][k] * state->x[k];
    for (int j = 0; j < {name}_inputs; ++j) sum += {name}_d[i][j] * v[j];
    state->y[i][(state->y_at + {name}_output_delay[i]) % {y_delay}] = sum;
    y[i] = state->y[i][state->y_at];
  }}
  for (int k = 0; k < {name}_states; ++k) {{
    const double *from = state->x + {name}_a_first[k];
    double sum = {name}_a[k][0] * from[0] + {name}_a[k][1] * from[1];
    for (int j = 0; j < {name}_inputs; ++j) sum += {name}_b[k][j] * v[j];
    next[k] = sum;
  }}
  for (int k = 0; k < {name}_states; ++k) state->x[k] = next[k];
}}

#endif
)";

/// At least one entry.
Eigen::MatrixXd not_empty(const Eigen::MatrixXd& m) {
  return m.size() > 0 ? m
                      : Eigen::MatrixXd::Zero(std::max<Eigen::Index>(m.rows(), 1),
                                              std::max<Eigen::Index>(m.cols(), 1));
}

void require_identifier(const std::string& name) {
  bool valid = !name.empty() && std::isdigit(static_cast<unsigned char>(name[0])) == 0;
  for (const char c : name)
    valid = valid && (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_') &&
            static_cast<unsigned char>(c) < 128;
  if (!valid)
    fail_request(
        "{0}.h: '{0}' is not a C identifier, as the names in the code need; use letters, digits "
        "and '_'",
        name);
}

}  // namespace

std::string model_code(const AdditiveModel& model, const std::string& name) {
  require_identifier(name);
  const SampledStateSpace sampled = sampled_state_space(model);
  if (sampled.input_delay_samples.minCoeff() < 0)
    throw std::invalid_argument(
        "the model has a negative delay, which code cannot compute; fit with '--delay estimate'");
  const StateSpace& system = sampled.system;
  std::string upper = name;
  for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  const auto format = [&](const char* text) {
    return fmt::format(fmt::runtime(text), fmt::arg("name", name), fmt::arg("NAME", upper),
                       fmt::arg("version", version()), fmt::arg("inputs", model.n_inputs()),
                       fmt::arg("outputs", model.n_outputs()), fmt::arg("states", system.order()),
                       fmt::arg("x_size", std::max<Eigen::Index>(system.order(), 2)),
                       fmt::arg("rate", model.sample_rate_hz),
                       fmt::arg("rate_hex", number(model.sample_rate_hz)),
                       fmt::arg("input_list", channel_comment(model.inputs)),
                       fmt::arg("output_list", channel_comment(model.outputs)),
                       fmt::arg("u_delay", sampled.input_delay_samples.maxCoeff() + 1),
                       fmt::arg("y_delay", sampled.output_delay_samples.maxCoeff() + 1));
  };
  std::string text = format(kHead);
  text += transition(name, system);
  text += table(name, "b", not_empty(system.B));
  text += table(name, "c", not_empty(system.C));
  text += table(name, "d", system.D);
  text += integers(name, "input_delay", sampled.input_delay_samples);
  text += integers(name, "output_delay", sampled.output_delay_samples);
  return text + format(kTail);
}

}  // namespace stageid

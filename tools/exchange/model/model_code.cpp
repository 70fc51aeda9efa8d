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
#include "tools/terminal/text_template.hpp"

namespace stageid {

extern const std::string_view model_code_h;  // from model_code.h.in

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
  const std::string tables = transition(name, system) + table(name, "b", not_empty(system.B)) +
                             table(name, "c", not_empty(system.C)) + table(name, "d", system.D) +
                             integers(name, "input_delay", sampled.input_delay_samples) +
                             integers(name, "output_delay", sampled.output_delay_samples);
  const auto text = [](auto value) { return fmt::format("{}", value); };
  return fill_template(model_code_h,
                       {{"name", name},
                        {"NAME", upper},
                        {"version", version()},
                        {"inputs", text(model.n_inputs())},
                        {"outputs", text(model.n_outputs())},
                        {"states", text(system.order())},
                        {"x_size", text(std::max<Eigen::Index>(system.order(), 2))},
                        {"rate", text(model.sample_rate_hz)},
                        {"rate_hex", number(model.sample_rate_hz)},
                        {"input_list", channel_comment(model.inputs)},
                        {"output_list", channel_comment(model.outputs)},
                        {"u_delay", text(sampled.input_delay_samples.maxCoeff() + 1)},
                        {"y_delay", text(sampled.output_delay_samples.maxCoeff() + 1)},
                        {"tables", tables}});
}

}  // namespace stageid

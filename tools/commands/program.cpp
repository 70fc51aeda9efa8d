#include "tools/commands/program.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/key_suggestion.hpp"
#include "acquisition/files/system_reason.hpp"
#include "acquisition/files/version.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/commands/commands.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/manual/command_tree.hpp"
#include "tools/manual/help_text.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

constexpr const char* kWelcome =
    R"(stageid measures and identifies multivariable motion stages in closed loop. Three things to try:

  stageid identify configs/experiment/wafer_stage_quick.yaml -o first
      identify a simulated wafer stage; writes a model and first/report.html
  stageid import YOUR_LOG.csv
      list the contents of a log from another program (also .mat, .h5, .npz);
      docs/guide.md describes the next steps
  stageid config schema
      list all keys of the configuration files

'stageid help' lists the commands, 'stageid help COMMAND' the options of one.)";

constexpr const char* kFooter =
    R"(Exit codes: 0 done; 1 file, link or interlock failed; 2 invalid request; 3 done, but do
not rely on the result (see the printed reason); 4 stopped for safety; 130 interrupted, recorded
data are kept.)";

constexpr const char* kMpiFooter =
    R"(mpirun -n COUNT stageid-mpi COMMAND ...: the processes divide the work of frf, modes, fit and
validate. Files, output and exit code are those of one process. See docs/scale.md.

)";

/// The text before and after `middle`.
std::optional<std::pair<std::string, std::string>> split_at(const std::string& text,
                                                            std::string_view middle) {
  const std::size_t at = text.find(middle);
  if (at == std::string::npos) return std::nullopt;
  return std::pair(text.substr(0, at), text.substr(at + middle.size()));
}

/// "--band: At least 2 required but received 1", "--output: 1 required TEXT missing"
std::string mismatch(const std::string& what) {
  for (const auto& [theirs, ours] :
       {std::pair(": At least ", "at least"), std::pair(": At Most ", "at most")})
    if (const auto halves = split_at(what, theirs))
      if (const auto counts = split_at(halves->second, " required but received "))
        return fmt::format("{}: got {} value{}; expected {} {}", halves->first, counts->second,
                           counts->second == "1" ? "" : "s", ours, counts->first);
  if (const auto halves = split_at(what, ": "); halves && halves->second.ends_with(" missing"))
    return halves->first + ": the value is missing";
  return what;
}

/// "--method: lmp not in {periodic,lpm}", "--can: Value 70 not in range 0 to 60"
std::string invalid(const std::string& what) {
  const auto halves = split_at(what, ": ");
  if (!halves) return what;
  const auto& [place, problem] = *halves;
  if (const auto set = split_at(problem, " not in {"))
    return wrong_word(place, set->first,
                      CLI::detail::split(set->second.substr(0, set->second.find('}')), ','));
  if (const auto range = split_at(problem, " not in range ");
      range && range->first.starts_with("Value "))
    if (const auto ends = split_at(range->second, " to "))
      return fmt::format("{}: got '{}'; expected {} to {}", place, range->first.substr(6),
                         std::stod(ends->first), std::stod(ends->second));  // 60, not 60.000000
  return what;
}

/// What CLI11 refused, as other messages are worded: "--band: got 1 value; expected at least 2".
std::string usage_problem(const CLI::ParseError& error) {
  std::string what = error.what();
  std::replace(what.begin(), what.end(), '\n', ' ');
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) return mismatch(what);
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr) return invalid(what);
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr)
    if (const auto halves = split_at(what, "Could not convert: "))
      if (const auto value = split_at(halves->second, " = "))
        return fmt::format("{}: got '{}'; expected a number", value->first, value->second);
  return what;
}

/// The CLI11 parser and the commands.
class Program {
 public:
  explicit Program(const Team& team) {
    console_.team = &team;
    app_.formatter(std::make_shared<HelpText>(help_columns()));  // the commands inherit it
    for (const auto command :
         {identify_command, design_command, run_command, log_command, frf_command, modes_command,
          fit_command, validate_command, watch_command, export_command, import_command,
          fleet_command, report_command, open_command, plot_command, config_command, node_command,
          manual_command, help_command})
      command(app_, console_);
    app_.name("stageid");
    app_.set_version_flag("--version", fmt::format("stageid {}", version()));
    app_.add_flag("--json", console_.json, "print the result as one JSON object on stdout");
    add_choice(
        app_, "--verbosity", console_.verbosity,
        "messages on stderr: quiet: only warnings and errors | normal, debug: also progress");
    app_.require_subcommand(0, 1);
    app_.footer((&team == &Team::one() ? "" : kMpiFooter) + std::string(kFooter));
  }

  int run(int argc, const char* const* argv) {
    if (argc <= 1) {
      fmt::print("{}\n", kWelcome);
      return kDone;
    }
    refuse_unknown_command(argc, argv);
    refuse_undivided_command(argc, argv);
    refuse_empty_words(argc, argv);
    if (!parse(argc, argv)) return kDone;
    if (app_.get_subcommands().empty())
      fail_request("no command given; 'stageid --help' lists the commands");
    meet_team();
    return console_.exit_code;
  }

 private:
  /// Waits until all processes have ended the command, or one has failed.
  void meet_team() const {
    const Team& team = *console_.team;
    const Team::Traffic sent = team.traffic();
    const Eigen::VectorXd all = team.sum(
        team.size(), 2,
        {Eigen::Vector2d(static_cast<double>(sent.messages), static_cast<double>(sent.bytes))});
    if (team.size() > 1 && console_.verbosity == Verbosity::debug)
      console_.message("{} processes sent {} messages with {} bytes", team.size(), all[0], all[1]);
  }

  /// An empty word is a variable without value in a script. As the name of an output it would mean none.
  static void refuse_empty_words(int argc, const char* const* argv) {
    for (int k = 2; k < argc; ++k)
      if (*argv[k] == '\0')
        fail_request("the word after '{}' is empty; write a value, or leave both out", argv[k - 1]);
  }

  /// Index of the first word that is not an option.
  static int command_at(int argc, const char* const* argv) {
    int first = 1;
    while (first < argc && argv[first][0] == '-')
      first += std::string_view(argv[first]) == "--verbosity" ? 2 : 1;
    return first;
  }

  /// Several processes would write the same files.
  void refuse_undivided_command(int argc, const char* const* argv) const {
    const int at = command_at(argc, argv);
    if (console_.team->size() == 1 || at >= argc) return;
    constexpr std::array kDivided = {"frf", "modes", "fit", "validate", "help"};
    if (std::ranges::find(kDivided, std::string_view(argv[at])) == kDivided.end())
      fail_request("{0}: cannot be divided between {1} processes; run 'stageid {0}' without mpirun",
                   argv[at], console_.team->size());
  }

  void refuse_unknown_command(int argc, const char* const* argv) const {
    const std::vector<std::string> names = names_of(command_tree(app_).commands);
    const int first = command_at(argc, argv);
    if (first >= argc || std::ranges::find(names, argv[first]) != names.end()) return;
    const std::string nearest = nearest_word(argv[first], names);
    fail_request("unknown command '{}'; {}", argv[first],
                 nearest.empty() ? "'stageid --help' lists them"
                                 : fmt::format("did you mean '{}'?", nearest));
  }

  /// Handles the exceptions of CLI11, which also uses them for help.
  /// @returns false if only help or the version was requested.
  bool parse(int argc, const char* const* argv) {
    try {
      app_.parse(argc, argv);
    } catch (const CLI::Success& success) {
      app_.exit(success);
      return false;
    } catch (const CLI::ParseError& error) {
      throw std::invalid_argument(explained(error));
    }
    return true;
  }

  /// The problem that CLI11 found, or the nearest word to an unknown one; and where to find help.
  std::string explained(const CLI::ParseError& error) {
    std::string path;
    const CLI::App* innermost = &app_;
    while (!innermost->get_subcommands().empty()) {
      innermost = innermost->get_subcommands().front();
      path += " " + innermost->get_name();
    }
    const CommandTree command = command_tree(*innermost);
    std::vector<std::string> known = names_of(command.commands);
    for (const CommandTree& tree : {command, command_tree(app_)})
      for (const std::string& flag : flags_of(tree.options)) known.push_back(flag);
    const std::vector<std::string> left_over = app_.remaining(true);
    for (const std::string& unknown : left_over) {
      const std::string nearest = nearest_word(unknown.substr(0, unknown.find('=')), known);
      if (!nearest.empty())
        return fmt::format("unknown argument '{}'; did you mean '{}'? See 'stageid{} --help'",
                           unknown, nearest, path);
    }
    const bool words_differ = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr ||
                              dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
    if (words_differ && innermost != &app_ && !command.commands.empty())
      return fmt::format("{}; use one of {}; see 'stageid{} --help'",
                         left_over.empty()
                             ? "a subcommand is missing"
                             : fmt::format("unknown subcommand '{}'", left_over.front()),
                         fmt::join(names_of(command.commands), ", "), path);
    if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr && !left_over.empty()) {
      const auto flag = std::ranges::find_if(
          left_over, [](const std::string& word) { return word.starts_with('-'); });
      return fmt::format("unexpected argument '{}'; see 'stageid{} --help'",
                         flag == left_over.end() ? left_over.front() : *flag, path);
    }
    return fmt::format("{}; see 'stageid{} --help'", usage_problem(error), path);
  }

  Console console_;
  CLI::App app_{"Measures and identifies multivariable motion stages in closed loop"};
};

}  // namespace

int run_program(int argc, const char* const* argv, const Team& team) {
  Program program(team);
  const int exit_code = program.run(argc, argv);
  // A full disk or a closed pipe at stdout must be reported. A closed terminal is an interrupt and keeps its exit
  // code.
  const bool lost = std::fflush(stdout) != 0 || std::ferror(stdout) != 0;
  if (lost && !interrupt_flag()) fail_file("stdout", "cannot be written: {}", system_reason(errno));
  return exit_code;
}

}  // namespace stageid

#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/files/output_file.hpp"
#include "hal/can/can_c_header.hpp"
#include "hal/can/can_dbc.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/config/config_schema.hpp"
#include "tools/config/controller_file.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/config/strict_yaml.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/experiment/loop_check.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/format_errors.hpp"

namespace stageid {
namespace {

/// The value of the key `format`, the kind of the file.
std::string format_of(const std::filesystem::path& file) {
  const YamlDocument document = YamlDocument::read(file);
  if (const YamlNode* format = document.value(document.root(), "format")) return format->text;
  document.fail(
      document.root().mark,
      "key 'format' is missing; write 'format: stageid-experiment' or 'format: stageid-stage'");
}

nlohmann::ordered_json schema_json(const std::vector<SchemaEntry>& entries) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const SchemaEntry& e : entries)
    list.push_back({{"depth", e.depth},
                    {"key", e.key},
                    {"type", e.type},
                    {"unit", e.unit},
                    {"range", e.range},
                    {"required", e.required},
                    {"default", e.default_value},
                    {"help", e.help}});
  return list;
}

struct FileKind {
  const char* name;
  const char* title;
  void (*describe)(ConfigVisitor&);
};
constexpr FileKind kFileKinds[] = {{"experiment", "An experiment", describe_experiment_keys},
                                   {"stage", "A stage", describe_stage_keys},
                                   {"controller", "A controller", describe_controller_keys}};

/// stageid config schema | check FILE... | dbc STAGE -o FILE | header STAGE -o FILE
class ConfigCommand {
 public:
  ConfigCommand(CLI::App& app, Console& console);

 private:
  void schema() const;
  void check() const;
  void check(const std::filesystem::path& file) const;
  void dbc() const;
  void header() const;
  StageConfig can_stage() const;
  void write(const std::string& text) const;

  Console& console_;
  std::string kind_;
  std::vector<std::filesystem::path> files_;
  std::filesystem::path stage_file_;
  std::filesystem::path output_;
};

ConfigCommand::ConfigCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* config =
      add_command(app, "config", "List the configuration keys; check configuration files");
  config->require_subcommand(1);
  CLI::App* schema_command =
      add_command(*config, "schema", "List every key with type, unit, range and default");
  schema_command->add_option("kind", kind_, "experiment | stage | controller; default: all")
      ->check(CLI::IsMember({"experiment", "stage", "controller"}));
  schema_command->final_callback([this] { schema(); });
  CLI::App* check_command = add_command(*config, "check", "Check experiment and stage files");
  check_command->add_option("files", files_, "YAML files")->required();
  check_command->final_callback([this] { check(); });
  CLI::App* dbc_command =
      add_command(*config, "dbc",
                  "Write the CAN frames of a stage file as a DBC database (can-utils, SavvyCAN)");
  dbc_command->add_option("stage", stage_file_, "stage file with a group 'can'")->required();
  dbc_command->add_option("-o,--output", output_, "file to write (.dbc)")->required();
  dbc_command->final_callback([this] { dbc(); });
  CLI::App* header_command = add_command(
      *config, "header",
      "Write the messages of a stage file as C structures for its node (firmware, Simulink)");
  header_command->add_option("stage", stage_file_, "stage file with a group 'can'")->required();
  header_command->add_option("-o,--output", output_, "file to write (.h)")->required();
  header_command->final_callback([this] { header(); });
}

void ConfigCommand::schema() const {
  nlohmann::ordered_json json;
  for (const FileKind& kind : kFileKinds) {
    if (!kind_.empty() && kind_ != kind.name) continue;
    const std::vector<SchemaEntry> entries = config_schema(kind.describe);
    console_.result(fmt::format("# {} file. Units are SI and part of the key names.\n{}",
                                kind.title, schema_text(entries)));
    json[kind.name] = schema_json(entries);
  }
  console_.result(json);
}

void ConfigCommand::check() const {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const std::filesystem::path& file : files_) {
    nlohmann::ordered_json messages = nlohmann::ordered_json::array();
    const auto tell = [&](const std::string& what) {
      console_.warning(what);
      messages.push_back(what);
    };
    try {
      check(file);
    } catch (const FormatErrors& errors) {
      for (const FormatError& error : errors.all()) tell(error.what());
    } catch (const FormatError& error) {
      tell(error.what());
    }
    json.push_back({{"file", file.string()}, {"valid", messages.empty()}});
    if (messages.empty()) continue;
    json.back()["errors"] = messages;
    console_.exit_code = kRequestWrong;
  }
  console_.result({{"files", json}});
}

void ConfigCommand::check(const std::filesystem::path& file) const {
  if (format_of(file) == "stageid-stage") {
    const StageConfig stage = load_stage_config(file);
    require_stable_loop(stage, console_);
    console_.result(fmt::format(
        "{}: stage '{}', {}, {}, {} Hz", file.string(), stage.spec.info.name,
        counted(stage.spec.info.actuators.size(), "actuator"),
        counted(stage.spec.info.sensors.size(), "sensor"), stage.spec.info.sample_rate_hz));
    return;
  }
  const ExperimentConfig experiment = load_experiment_config(file);
  const ExperimentPlan plan = outline_plan(experiment);
  if (!experiment.limits || std::filesystem::exists(experiment.limits->prior))
    require_stable_loop(experiment, console_);
  console_.result(fmt::format("{}: {}, {:.1f} min, {}", file.string(),
                              counted(plan.runs().size(), "run"), plan.duration_s() / 60.0,
                              counted(plan.grid().size(), "line")));
}

StageConfig ConfigCommand::can_stage() const {
  StageConfig stage = load_stage_config(stage_file_);
  if (!stage.can.present)
    throw std::invalid_argument(
        fmt::format("{}: has no group 'can'; see 'stageid config schema'", stage_file_.string()));
  return stage;
}

void ConfigCommand::write(const std::string& text) const {
  write_text_file(output_, text);
  console_.result(fmt::format("wrote {}", output_.string()));
  console_.result({{"file", output_.string()}});
}

void ConfigCommand::dbc() const {
  const StageConfig stage = can_stage();
  const StageInfo& info = stage.spec.info;
  write(can_dbc(can_layout(stage.can.spec, info), info));
}

void ConfigCommand::header() const {
  const StageConfig stage = can_stage();
  const StageInfo& info = stage.spec.info;
  write(can_c_header(can_layout(stage.can.spec, info), info, stage.spec.limits));
}

}  // namespace

std::shared_ptr<void> config_command(CLI::App& app, Console& console) {
  return std::make_shared<ConfigCommand>(app, console);
}

}  // namespace stageid

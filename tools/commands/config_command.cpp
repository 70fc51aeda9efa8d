#include "tools/commands/commands.hpp"

#include <filesystem>
#include <string>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/output_file.hpp"
#include "hal/can/can_c_header.hpp"
#include "hal/can/can_dbc.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/config/config_schema.hpp"
#include "tools/config/controller_file.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/config/yaml_document.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/experiment/loop_check.hpp"
#include "tools/fleet/fleet_config.hpp"
#include "tools/fleet/fleet_jobs.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/format_errors.hpp"
#include "tools/terminal/json.hpp"

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

Json schema_json(const std::vector<SchemaEntry>& entries) {
  Json list = Json::array();
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
                                   {"controller", "A controller", describe_controller_keys},
                                   {"fleet", "A fleet", describe_fleet_keys}};

/// stageid config schema | check FILE... | dbc STAGE -o FILE | header STAGE -o FILE
struct ConfigFlags {
  std::string kind;
  std::vector<std::filesystem::path> files;
  std::filesystem::path stage_file;
  std::filesystem::path output;
};

void print_schema(const ConfigFlags& flags, Console& console) {
  Json json;
  for (const FileKind& kind : kFileKinds) {
    if (!flags.kind.empty() && flags.kind != kind.name) continue;
    const std::vector<SchemaEntry> entries = config_schema(kind.describe);
    console.result("# {} file. Units are SI and part of the key names.\n{}", kind.title,
                   schema_text(entries));
    json[kind.name] = schema_json(entries);
  }
  console.result(json);
}

void check_file(const std::filesystem::path& file, Console& console) {
  if (format_of(file) == "stageid-stage") {
    const StageConfig stage = load_stage_config(file);
    require_stable_loop(stage, console);
    console.result("{}: stage '{}', {}, {}, {} Hz", file.string(), stage.spec.info.name,
                   counted(stage.spec.info.actuators.size(), "actuator"),
                   counted(stage.spec.info.sensors.size(), "sensor"),
                   stage.spec.info.sample_rate_hz);
    return;
  }
  if (format_of(file) == "stageid-fleet") {
    const FleetConfig fleet = load_fleet_config(file);
    console.result("{}: {}", file.string(), counted(fleet_logs(fleet, console).size(), "log"));
    return;
  }
  const ExperimentConfig experiment = load_experiment_config(file);
  const ExperimentPlan plan = outline_plan(experiment);
  if (!experiment.limits || std::filesystem::exists(experiment.limits->prior))
    require_stable_loop(experiment, console);
  console.result("{}: {}, {:.1f} min, {}", file.string(), counted(plan.runs().size(), "run"),
                 plan.duration_s() / 60.0, counted(plan.grid().size(), "line"));
}

void check_config(const ConfigFlags& flags, Console& console) {
  Json json = Json::array();
  for (const std::filesystem::path& file : flags.files) {
    Json messages = Json::array();
    const auto tell = [&](const std::string& what) {
      console.warning(what);
      messages.push_back(what);
    };
    try {
      check_file(file, console);
    } catch (const FormatErrors& errors) {
      for (const FormatError& error : errors.all()) tell(error.what());
    } catch (const FormatError& error) {
      tell(error.what());
    }
    json.push_back({{"file", file.string()}, {"valid", messages.empty()}});
    if (messages.empty()) continue;
    json.back()["errors"] = messages;
    console.exit_code = kRequestWrong;
  }
  console.result({{"files", json}});
}

/// A file for the users of the CAN frames: a DBC database, or a header in C.
template <bool kHeader>
void write_can_file(const ConfigFlags& flags, Console& console) {
  const StageConfig stage = load_stage_config(flags.stage_file);
  if (!stage.can.present)
    fail_request("{}: has no group 'can'; see 'stageid config schema'", flags.stage_file.string());
  const StageInfo& info = stage.spec.info;
  const CanLayout layout = can_layout(stage.can.spec, info);
  write_text_file(flags.output,
                  kHeader ? can_c_header(layout, info, stage.spec.limits) : can_dbc(layout, info));
  console.result("wrote {}", flags.output.string());
  console.result({{"file", flags.output.string()}});
}

}  // namespace

void config_command(CLI::App& app, Console& console) {
  CLI::App& config =
      add_command(app, "config", "List the configuration keys; check configuration files");
  config.require_subcommand(1);
  auto [schema, schema_flags] = add_command(
      config, console, "schema", "List every key with type, unit, range and default", print_schema);
  schema
      .add_option("kind", schema_flags.kind,
                  "experiment | stage | controller | fleet; default: all")
      ->check(CLI::IsMember({"experiment", "stage", "controller", "fleet"}));
  auto [check, check_flags] = add_command(config, console, "check",
                                          "Check experiment, stage and fleet files", check_config);
  add_required(check, "files", check_flags.files, "YAML files");
  const auto add_can_file = [&](const char* name, const char* help, const char* output,
                                void (*write)(const ConfigFlags&, Console&)) {
    auto [command, flags] = add_command(config, console, name, help, write);
    add_required(command, "stage", flags.stage_file, "stage file with a group 'can'");
    add_required(command, "-o,--output", flags.output, output);
  };
  add_can_file("dbc",
               "Write the CAN frames of a stage file as a DBC database (can-utils, SavvyCAN)",
               "file to write (.dbc)", write_can_file<false>);
  add_can_file(
      "header",
      "Write the messages of a stage file as C structures for its node (firmware, Simulink)",
      "file to write (.h)", write_can_file<true>);
}

}  // namespace stageid

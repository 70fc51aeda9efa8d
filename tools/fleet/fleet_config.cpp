#include "tools/fleet/fleet_config.hpp"

#include <string_view>

#include "tools/config/yaml_document.hpp"
#include "tools/database/database.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/fit/fit_words.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {
namespace {

struct FleetFile {
  std::size_t format = 0;
  std::string table;
  std::string store = "fleet.db";
  std::string results = "fleet_results";
  FleetConfig config;
};

void describe_identification(ConfigVisitor& v, FleetConfig& config) {
  group(v, "frf", describe_frf_keys, config.frf, kOptional,
        "estimation of the frequency response, as in an experiment file");
  group(v, "fit", describe_fit_keys, config.fit, kOptional,
        "fit of the model, as in an experiment file");
  int realization = 0;
  count(v, "validation_realization", realization, 0, 10000, kOptional,
        "realization held back from the fit, counted from 1; 0: none");
  config.validation_realization = realization - 1;
}

void describe_fleet(ConfigVisitor& v, FleetFile& file) {
  FleetConfig& config = file.config;
  v.choice("format", file.format, {"stageid-fleet"}, kRequired, "file type");
  v.texts("logs", config.logs, {}, kOptional,
          "logs, one identification each, relative to this file; *, ? and [...] match names");
  v.text("table", file.table, kOptional,
         "instead of or besides logs: a CSV file with the columns log, stage and time_utc; all but "
         "log may be omitted, all others are tags");
  v.require(!config.logs.empty() || !file.table.empty(), "format",
            "no logs: write 'logs: [PATTERN, ...]' or 'table: FILE.csv'");
  v.text(
      "store", file.store, kOptional,
      "database of the results: a file, relative to this one, or postgresql://USER@HOST/DATABASE");
  v.text("results", file.results, kOptional, "folder of models and reports, relative to this file");
  choose(v, "stage_name", config.stage_name, kOptional,
         "name of a stage that the table does not name: log: the one in its log, folder: that of "
         "the folder of its log");
  v.named_texts("tags", config.tags, kOptional,
                "tags of every identification, such as a site; the table has those that differ");
  group(v, "identification", describe_identification, config, kOptional,
        "options; a change runs all jobs again");
}

/// The values below a node, without comments and layout.
SortedJson values_of(const YamlDocument& document, const YamlNode& node) {
  SortedJson out;
  if (node.kind == YamlNode::Kind::scalar) out = node.text;
  for (const std::size_t item : node.items) out.push_back(values_of(document, document.node(item)));
  for (const YamlNode::Entry& entry : node.entries)
    out[entry.key] = values_of(document, document.node(entry.value));
  return out;
}

/// The name of a folder within a pattern.
std::string escaped(const std::string& name) {
  std::string out;
  for (const char c : name) {
    if (std::string_view("*?[]\\").find(c) != std::string_view::npos) out += '\\';
    out += c;
  }
  return out;
}

}  // namespace

void describe_fleet_keys(ConfigVisitor& visitor) {
  FleetFile file;
  describe_fleet(visitor, file);
}

FleetConfig load_fleet_config(const std::filesystem::path& path) {
  const YamlDocument document = YamlDocument::read(path);
  FleetFile file;
  read_config(document, [&](ConfigVisitor& visitor) { describe_fleet(visitor, file); });
  FleetConfig& config = file.config;
  const auto beside = [&](const std::string& name) {
    return (path.parent_path() / name).lexically_normal();
  };
  config.file = path;
  const std::filesystem::path folder = escaped(path.parent_path().string());
  for (std::string& pattern : config.logs) pattern = (folder / pattern).lexically_normal().string();
  if (!file.table.empty()) config.table = beside(file.table);
  config.store =
      is_database_url(file.store) ? std::filesystem::path(file.store) : beside(file.store);
  config.results = beside(file.results);
  const YamlNode* identification = document.value(document.root(), "identification");
  config.identification =
      identification == nullptr ? "{}" : values_of(document, *identification).dump();
  return std::move(file.config);
}

}  // namespace stageid

#include "tools/experiment/config_plan.hpp"

#include "acquisition/files/fail.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "tools/experiment/limited_plan.hpp"

namespace stageid {

FrequencyGrid grid_of(const ExperimentConfig& config) {
  if (!config.listed_lines.empty())
    return {config.stage.spec.info.sample_rate_hz, config.samples_per_period, config.listed_lines};
  return FrequencyGrid::band(config.stage.spec.info.sample_rate_hz, config.samples_per_period,
                             config.lines);
}

ExperimentPlan make_plan(const ExperimentConfig& config) {
  if (config.limits) return make_limited_plan(config).design.plan;
  return ExperimentPlan(grid_of(config), config.experiment);
}

ExperimentPlan outline_plan(const ExperimentConfig& config) {
  ExperimentSpec experiment = config.experiment;
  if (config.limits) experiment.crest_iterations = 0;
  return ExperimentPlan(grid_of(config), std::move(experiment));
}

ExperimentPlan read_plan_of(const ExperimentConfig& config, const std::filesystem::path& file) {
  ExperimentPlan plan = read_experiment_plan(file);
  const ExperimentPlan wanted = outline_plan(config);
  const ExperimentSpec& is = plan.spec();
  const ExperimentSpec& should = wanted.spec();
  const char* differs = !(plan.grid() == wanted.grid())                    ? "the lines"
                        : is.scheme != should.scheme                       ? "the scheme"
                        : is.axes.size() != should.axes.size()             ? "the axes"
                        : is.realizations != should.realizations           ? "realizations"
                        : is.periods != should.periods                     ? "periods"
                        : is.transient_periods != should.transient_periods ? "transient_periods"
                        : is.crest_iterations != config.experiment.crest_iterations
                            ? "crest_iterations"
                        : is.seed != should.seed ? "the seed"
                                                 : nullptr;
  for (std::size_t p = 0; differs == nullptr && p < is.axes.size(); ++p) {
    if (is.axes[p].channel != should.axes[p].channel) differs = "an axis";
    if (!config.limits && plan.amplitude() != wanted.amplitude()) differs = "the level";
  }
  if (differs != nullptr)
    fail_format(file, "", "differs in {} from {}; design the experiment again", differs,
                config.file.string());
  return plan;
}

}  // namespace stageid

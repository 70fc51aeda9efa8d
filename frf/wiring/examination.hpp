#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/channel_choice.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// The checks of one log, ordered so that each can rely on the previous ones.
class Examination {
 public:
  Examination(HealthRecord&& record, const std::optional<NominalStage>& nominal)
      : record_(std::move(record)), nominal_(nominal) {}

  std::vector<Finding> examine();

 private:
  void check_realization();
  std::vector<Finding> examine_other();
  void add_others(std::vector<Finding>& own);
  void check_others(std::vector<Finding> own);
  bool follows_stage();
  void check_cycles();
  void check_samples();
  void check_responses();
  void find_drowned(const std::vector<Eigen::Index>& sensors);
  void check_arrival();
  void check_excitation();
  std::string difference_of_stage() const;
  void check_declared();
  void check_injection();
  void check_without_stage();
  void check_recording();
  void check_stage();
  void check_inputs();
  void check_excluded();

  void find(Severity severity, Cause cause, std::string channel, std::string what,
            std::string figure, std::string remedy) {
    findings_.push_back({severity, cause, std::move(channel), std::move(what), std::move(figure),
                         std::move(remedy)});
  }
  /// A property that this log cannot show.
  void find_unchecked(Cause cause, std::string what, std::string remedy) {
    find(Severity::unchecked, cause, "", std::move(what), "", std::move(remedy));
  }
  const std::string& name(Eigen::Index channel) const;  // of [sensors; actuators]
  bool spoilt(Eigen::Index channel) const {
    return std::ranges::find(spoilt_, channel) != spoilt_.end();
  }
  bool found(Cause cause) const;
  void find_clipped(Eigen::Index channel, double log_p);
  bool find_suspected(Eigen::Index first, Eigen::Index count);
  std::vector<Eigen::Index> excited_actuators() const {
    return stageid::excited_actuators(record_.info, record_.axes);
  }
  std::optional<bool> expected_to_respond(Eigen::Index sensor) const;
  bool expected_above_noise(Eigen::Index sensor) const;
  std::optional<bool> controlled(Eigen::Index actuator) const;
  std::string why_no_nominal(bool all_sensors) const;

  HealthRecord record_;
  const std::optional<NominalStage>& nominal_;
  std::vector<Finding> findings_;
  std::vector<Eigen::Index> spoilt_;         // of [sensors; actuators]: dead or clipped
  std::vector<Eigen::Index> spoilt_of_log_;  // those known from the samples of all runs
};

}  // namespace stageid

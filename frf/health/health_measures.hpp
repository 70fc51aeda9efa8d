#pragma once

#include <Eigen/Core>
#include <functional>

#include "frf/runs/health_record.hpp"

namespace stageid {

inline constexpr const char* kRemedyOfLimitCycle =
    "raise the level, excite all axes in every experiment, or use a finer converter";

/// Whether a response of the channel (of [sensors; actuators]) is above its noise. One F test per line of the mean over
/// periods (`response` of the line's index: one value per experiment) against the scatter, over the experiments;
/// Fisher's sum over the lines; kSignificance. True with only one period, because the noise is unknown then.
bool above_noise(const HealthRecord& record, Eigen::Index channel,
                 const std::function<Eigen::RowVectorXcd(Eigen::Index)>& response);

/// Whether the channel moves with the excitation: above_noise() of what it recorded.
bool responds(const HealthRecord& record, Eigen::Index channel);

/// Median over the lines of the multiple coherence of one period: the share of the power that repeats. 1 for a
/// channel without power.
double median_coherence(const HealthRecord& record, Eigen::Index channel);

/// Median over the lines of the coherence between what does not repeat in two channels, corrected for its expectation
/// 1/nu if they are independent; 0 with nu = scatter_dof() < 2.
double common_motion(const HealthRecord& record, Eigen::Index one, Eigen::Index other);

/// Median over the lines of the power of noise in the means of the sensors, relative to their power.
double noise_share(const HealthRecord& record);

/// Condition number with rows of norm one, because their units differ; infinite if a row is zero.
double condition(const Eigen::MatrixXcd& M);

}  // namespace stageid

#pragma once

#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/frf_options.hpp"
#include "frf/runs/health_record.hpp"

namespace stageid {

/// Estimates the plant from closed-loop logs by the indirect method.
///
/// For realization m, let Z = [Y; U] be the spectra at the excited lines, averaged over the periods after the
/// transient, and Z_m = Z R^-1 over the n_r experiments. Then
///   G = (mean_m Y_m) (mean_m U_m)^-1.
/// Variances follow by first-order propagation, vec(dG) = (U^-T kron [I, -G]) vec(dZ): noise from the scatter
/// over periods, total from the scatter over realizations. Both are those of the mean. With one measured period
/// noise_variance is empty, with one realization total_variance is. Where noise leaks between the periods of a run, their
/// scatter overstates it, and the realizations' is used: lower_leaked_noise().
///
/// The noise of Y - G U is that of the open loop for any excitation. Its covariance C_E is therefore pooled over
/// the experiments of a realization: Cov(vec G) = sum_e (q_e q_e^H) kron C_E / P_e, with q_e the e-th row of U^-1
/// and M E (P-1) degrees of freedom (minus one per dropped period). If the noise differs between experiments, each
/// has its own C_E, with the degrees of freedom of Welch and Satterthwaite: experiment_noise.hpp.
///
/// With FrfMethod::lpm, Z is the steady state of the whole record. The transient is removed by a local polynomial or
/// rational model (transient_model.hpp), and C_E follows from its residual beside the lines: 9 degrees of freedom
/// per stretch of periods, even for one period. Neighbouring lines share bins, so their variances are correlated
/// over some 16 bins. A stretch ends at marked periods, or after 16 periods: record_spectra.hpp. Memory: 16
/// periods per thread.
///
/// If one experiment excites several axes, each on its own lines (zippered), it is a whole realization. The
/// responses to each axis are then modelled between its lines (zippered_fit.hpp), with either method. The result
/// has the lines between the axes' first and last ones. Errors of neighbouring lines are correlated
/// (FrfEstimate::correlated_lines), and interpolation_misfit shows where the interpolation is unreliable. The
/// noise between periods is pooled with the residual of the local models, which includes distortions and
/// interpolation errors; with one period only the residual is used.
///
/// Incomplete runs are skipped; of several complete runs of one (realization, experiment), the last is used. Periods
/// with a marked sample are dropped. Of outliers (periodic, three periods or more: period_outliers.hpp), short glitches
/// are replaced, other periods dropped; with lpm, periods with a glitch are dropped (record_glitches.hpp). A realization with a run without clean periods is discarded
/// (FrfEstimate::left_out_realizations). With two periods and two realizations, the plant's linearity is tested,
/// see nonlinearity_test(). If only some of the excited actuators are requested as inputs, they are columns of the
/// whole estimate, because the others move too.
///
/// If the realizations show that actuators apply their commands in steps, the response is that to what was applied
/// (docs/theory.md, section 3): up to a few more passes over the logs. "actuator_steps" in the provenance lists them.
///
/// Memory (periodic): per thread one period of samples and 16 of spectra; in total the spectra and scatters of one
/// realization, (n_y + n_u)^2 numbers per line and experiment.
/// Source: docs/theory.md, section 3; Pintelon and Schoukens, System Identification (2012).
/// @throws std::invalid_argument / FormatError: fewer experiments than inputs, singular excitation (naming line
///         and frequency), a period that does not divide the record, no realization in which all runs have a
///         clean period, unknown channels; with lpm a single period without empty lines; zippered lines that
///         are too few or differ between realizations; covariance_lines as in smooth_covariance().
FrfEstimate estimate_plant_frf(const std::vector<const LogReader*>& logs,
                               const FrfOptions& options = {});

struct FrfAndHealth {
  FrfEstimate frf;
  HealthRecord
      health;  ///< as from read_health_record(), without the periods that differ from the others
};

/// The estimate and the input of the health checks, from one pass over the logs.
/// @throws the same as estimate_plant_frf()
FrfAndHealth estimate_plant_frf_and_health(const std::vector<const LogReader*>& logs,
                                           const FrfOptions& options = {});

}  // namespace stageid

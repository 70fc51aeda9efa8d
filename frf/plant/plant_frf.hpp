#pragma once

#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/frf_options.hpp"
#include "frf/runs/health_record.hpp"

namespace stageid {

/// Estimates the plant from closed-loop logs by the indirect method.
///
/// For realization m, with Z = [Y; U] at the excited lines, averaged over the periods after the
/// transient, Z_m = Z R^-1 over the n_r experiments, and
///   G = (mean_m Y_m) (mean_m U_m)^-1.
/// Variances by first-order propagation, vec(dG) = (U^-T kron [I, -G]) vec(dZ): noise from the
/// scatter over periods, total from the scatter over realizations. Both are of the mean. With one
/// measured period noise_variance is empty, with one realization total_variance is.
///
/// The noise of Y - G U is that of the open loop, whatever was excited, so its covariance C_E is
/// pooled over the experiments of a realization: Cov(vec G) = sum_e (q_e q_e^H) kron C_E / P_e with
/// q_e the e-th row of U^-1, and M E (P-1) degrees of freedom (each dropped period takes one). Where the
/// experiments' noise is found to differ, each has its own C_E and the degrees of freedom are those of Welch and
/// Satterthwaite: experiment_noise.hpp.
///
/// With FrfMethod::lpm Z is the steady state of the whole record, the transient removed by a local
/// polynomial or rational model (transient_model.hpp), and C_E comes from what that leaves beside
/// the lines: 9 degrees of freedom a stretch, from one period on. Neighbouring lines share bins, so
/// their variances are correlated over some 16 bins. Stretches end at marked periods and after 16
/// periods at most: record_spectra.hpp. Memory: 16 periods a thread.
///
/// If one experiment excites several axes, each on lines of its own (zippered), it is a whole
/// realization: the responses to each axis are modelled between its lines, see zippered_fit.hpp, after
/// either method. The result has the lines between the axes' first and last ones; errors of
/// neighbouring lines are correlated (FrfEstimate::correlated_lines), interpolation_misfit shows where
/// the interpolation cannot be trusted. The noise is that between periods pooled with what the local
/// models leave, distortions and interpolation errors among it; with one period that alone.
///
/// Incomplete runs are passed over; of several complete runs of one (realization, experiment) the
/// last counts. Periods with a marked sample are dropped, and (periodic, three periods or more)
/// those whose scatter shows that they do not belong with the others: period_check.hpp; with lpm those with
/// a glitch: glitch_check.hpp. A realization
/// with a run that has no clean period is left out (FrfEstimate::left_out_realizations). With two
/// periods and two realizations the plant's linearity is tested, see nonlinearity_test(). Inputs asked
/// for that are only some of the excited actuators are columns of the whole estimate: the others move
/// too.
///
/// Memory (periodic): one period of samples and 16 of spectra a thread, and the spectra and scatters of one
/// realization, (n_y + n_u)^2 numbers a line and experiment.
/// Source: method.md section 3; Pintelon and Schoukens, System Identification (2012).
/// @throws std::invalid_argument / FormatError: fewer experiments than inputs, singular excitation
///         (names line and frequency), a period that does not divide the record, no realization
///         whose runs all have a clean period, channels unknown;
///         with lpm a single period without empty lines; zippered lines that are too few, or not the
///         same in all realizations; covariance_lines as smooth_covariance().
FrfEstimate estimate_plant_frf(const std::vector<const LogReader*>& logs,
                               const FrfOptions& options = {});

struct FrfAndHealth {
  FrfEstimate frf;
  HealthRecord health;  ///< as read_health_record() gives it
};

/// The estimate and what the checks of the data's health look at, from one reading of the logs.
/// @throws what estimate_plant_frf() throws
FrfAndHealth estimate_plant_frf_and_health(const std::vector<const LogReader*>& logs,
                                           const FrfOptions& options = {});

}  // namespace stageid

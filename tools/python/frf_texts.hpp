#pragma once

namespace stageid {

// Texts of help(stageid) on frequency responses.

inline constexpr const char* kFrfDoc =
    R"(A frequency response G(j omega_k) with its uncertainty: the content of frf.h5.

N lines, n_y outputs, n_u inputs. Arrays are read-only views, not copied.)";

inline constexpr const char* kFrfInitDoc =
    R"(A frequency response from other data. The arrays are copied.

frequency_hz [N]                  Hz, increasing
response [N, n_y, n_u]            complex, unit of output over unit of input
noise_variance, total_variance [N, n_y, n_u]    E|dG|^2 of this response; None: unknown
noise_dof, total_dof              their complex degrees of freedom; 0: unknown
inputs, outputs                   names; default u1 ..., y1 ...; input_units, output_units: one per channel
sample_rate_hz                    Hz; 0: unknown
hold                              'zoh' for a plant in a digital loop (needs the sample rate), else 'none'

Raises RequestError if shapes do not match or values are not finite.)";

inline constexpr const char* kResponseDoc =
    "complex128 [N, n_y, n_u], unit of output over unit of input";
inline constexpr const char* kNoiseVarianceDoc =
    "float64 [N, n_y, n_u], E|dG|^2 due to noise, from periods; None if unknown";
inline constexpr const char* kTotalVarianceDoc =
    "float64 [N, n_y, n_u], E|dG|^2 due to noise and nonlinearity, from realizations; None if "
    "unknown";

inline constexpr const char* kHealthDoc =
    R"(Findings on the data, a list of dicts: severity ('fault', 'doubt', 'unchecked'), cause, channel, what, figure,
remedy. With a fault, the program ends with exit code 3.)";

inline constexpr const char* kSelectDoc =
    R"(Selects the lines in band_hz = (low, high), in Hz, and the named inputs and outputs in the given order.

Returns a new Frf. Raises RequestError if no line remains or a name is unknown.)";

inline constexpr const char* kCompensateDoc =
    R"(Compensates 'delay' (including the half sample of the hold) or 'hold' (and the delay). Returns a new Frf.

delay_s is in s and excludes the delay of the hold. Raises RequestError if the response is already compensated or
the sample rate is unknown.)";

inline constexpr const char* kRadiusDoc =
    R"(Radii of circles that contain the true response with probability `level`, float64 [N, n_y, n_u], in the unit of
the response.

variance is 'noise' or 'total'. The radii account for the degrees of freedom. Raises RequestError if that variance is
unknown.)";

inline constexpr const char* kEstimateDoc =
    R"(Estimates the plant's frequency response from closed-loop logs, G = (mean Y) (mean U)^-1 line by line.

logs                 a Log, a file name, or a list of these
inputs, outputs      names of actuators and sensors; empty: the excited actuators, all sensors
realizations         realizations to use, from 0 (the flag of the program counts from 1); empty: all complete ones
transient_periods    number of periods to discard; None: the value of the log ('lpm': 0)
method               'periodic', or 'lpm', which uses whole records and models the transient
covariance           'diagonal' or 'full'
periods              'consistent' discards outliers ('lpm': periods with a glitch); 'unmarked' uses all unmarked periods
covariance_lines     odd number of lines over which the noise covariance is smoothed
health               True: also examine the data, see Frf.health
stage                stage file to check the data against; None: the stage file in the log
threads              0: all cores; the result does not depend on it

Returns an Frf with the same numbers as `stageid frf`. Releases the GIL; Ctrl-C interrupts it.
Raises RequestError, FormatError, FileError.)";

inline constexpr const char* kReadFrfDoc =
    "Reads frf.h5 and returns an Frf. Raises FileError, FormatError.";
inline constexpr const char* kWriteFrfDoc =
    "Writes frf.h5 atomically, identical to the file of the program. Raises FileError.";

}  // namespace stageid

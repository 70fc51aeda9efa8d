#pragma once

namespace stageid {

// What help(stageid) tells of frequency responses.

inline constexpr const char* kFrfDoc =
    R"(A frequency response G(j omega_k) with its uncertainty: what frf.h5 holds.

N lines, n_y outputs, n_u inputs. Arrays are read-only views, not copied.)";

inline constexpr const char* kFrfInitDoc =
    R"(A response from elsewhere; its arrays are copied.

frequency_hz [N]                  Hz, rising
response [N, n_y, n_u]            complex, unit of output over unit of input
noise_variance, total_variance [N, n_y, n_u]    E|dG|^2 of the response given; None: unknown
noise_dof, total_dof              their complex degrees of freedom; 0: unknown
inputs, outputs                   names; else u1 ..., y1 ...; input_units, output_units: one a channel
sample_rate_hz                    Hz; 0: unknown
hold                              'zoh' as a digital loop sees the plant (needs the rate), else 'none'

Raises RequestError where shapes do not fit or numbers are not finite.)";

inline constexpr const char* kResponseDoc =
    "complex128 [N, n_y, n_u], unit of output over unit of input";
inline constexpr const char* kNoiseVarianceDoc =
    "float64 [N, n_y, n_u], E|dG|^2 by noise, from periods; None if unknown";
inline constexpr const char* kTotalVarianceDoc =
    "float64 [N, n_y, n_u], E|dG|^2 by noise and nonlinearity, from realizations; None if unknown";

inline constexpr const char* kHealthDoc =
    R"(What was found in the data, a list of dicts: severity ('fault', 'doubt', 'unchecked'), cause, channel, what,
figure, remedy. With a fault the program ends with exit code 3.)";

inline constexpr const char* kSelectDoc =
    R"(The lines of band_hz = (low, high) in Hz and the named inputs and outputs, in the order asked, as a new Frf.

Raises RequestError if no line is left or a name is unknown.)";

inline constexpr const char* kCompensateDoc =
    R"(Takes 'delay' (with the hold's half sample) or 'hold' (and delay) out of the response; a new Frf.

delay_s in s, beside the hold's own. Raises RequestError if that was done before or the rate is unknown.)";

inline constexpr const char* kRadiusDoc =
    R"(Radii of circles that hold the true response with probability `level`, float64 [N, n_y, n_u], its unit.

variance: 'noise' or 'total'. Counts the degrees of freedom. Raises RequestError if there is no such variance.)";

inline constexpr const char* kEstimateDoc =
    R"(Estimates the plant's frequency response from closed-loop logs, G = (mean Y) (mean U)^-1 line by line.

logs                 a Log, the name of a file, or a list of these
inputs, outputs      names of actuators and sensors; empty: those excited, all
realizations         which, from 0 (the flag of the program counts from 1); empty: all complete ones
transient_periods    left out, instead of the log's own; None: the log's own ('lpm': none)
method               'periodic', or 'lpm': whole records, the transient modelled
covariance           'diagonal' or 'full'
periods              'consistent': without those that do not belong with the others ('lpm': with a glitch); or 'unmarked'
covariance_lines     odd: the noise covariance is smoothed over so many lines
health               examine the data as well: Frf.health
stage                stage file that they are held against; None: the one that the log carries
threads              0: all cores; the result does not depend on it

Returns Frf: the numbers of `stageid frf`. Other Python threads run meanwhile; Ctrl-C ends it.
Raises RequestError, FormatError, FileError.)";

inline constexpr const char* kReadFrfDoc = "frf.h5 as Frf. Raises FileError, FormatError.";
inline constexpr const char* kWriteFrfDoc =
    "Writes frf.h5, whole or not at all: the bytes that the program writes. Raises FileError.";

}  // namespace stageid

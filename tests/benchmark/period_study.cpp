// Does dropping periods win more than it costs? Records with noise of many colours, clean and with glitches.
//
//   period_study [first seed = 1] [periods per colour = 1000] [method = 0: periodic | 1: lpm]
//                [channels = 3] [periods per run = 0: 3, 4, 6, 10 and 20 in turn] [colour]
//
// Per colour of noise: the clean periods that are dropped or changed, of 1000; the error of the FRF over that of the
// plain average of the same clean periods; the same with glitches of 5 to 500 standard deviations in every twentieth
// period (of less than half of a run's), spikes, bumps and steps, in one channel or all; and that without dropping.
// Errors are rms, on each line relative to the plain clean average; in brackets absolute, which the noisiest lines
// decide.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>

#include "frf/plant/plant_frf.hpp"
#include "tests/benchmark/arguments.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

using Eigen::Index;

constexpr double kRateHz = 8000.0;
constexpr int kPeriod = 4000;
constexpr int kLines = 600;

double normal(ComplexNoise& random) { return std::numbers::sqrt2 * random.gaussian().real(); }
double log_uniform(ComplexNoise& random, double low, double high) {
  return low * std::pow(high / low, random.uniform());
}

Eigen::VectorXd white(Index count, ComplexNoise& random) {
  return Eigen::VectorXd::NullaryExpr(count, [&] { return normal(random); });
}

Eigen::VectorXd of_unit_variance(const Eigen::VectorXd& x) {
  const double mean = x.mean();
  return (x.array() - mean) / std::sqrt((x.array() - mean).square().mean());
}

/// White noise through 1 / (1 + 2 zeta s / w + s^2 / w^2).
Eigen::VectorXd resonant(Index count, double frequency_hz, double zeta, ComplexNoise& random) {
  const double angle = 2.0 * std::numbers::pi * frequency_hz / kRateHz;
  const std::complex<double> pole =
      std::exp(angle * std::complex<double>(-zeta, std::sqrt(std::max(1e-6, 1.0 - zeta * zeta))));
  const auto settle = static_cast<Index>(std::min(8.0 / (zeta * angle), 4e5));
  Eigen::VectorXd x(count);
  double before = 0.0;
  double last = 0.0;
  for (Index n = -settle; n < count; ++n) {
    const double next = 2.0 * pole.real() * last - std::norm(pole) * before + normal(random);
    before = last;
    last = next;
    if (n >= 0) x[n] = next;
  }
  return of_unit_variance(x);
}

Eigen::VectorXd walk(Index count, ComplexNoise& random) {
  Eigen::VectorXd x(count);
  double sum = 0.0;
  for (Index n = 0; n < count; ++n) x[n] = sum += normal(random);
  return x / std::sqrt(static_cast<double>(kPeriod));
}

/// First-order noises, one per octave.
Eigen::VectorXd flicker(Index count, ComplexNoise& random) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(count);
  for (double corner_hz = 0.05; corner_hz < kRateHz / 4.0; corner_hz *= 2.0) {
    const double pole = std::exp(-2.0 * std::numbers::pi * corner_hz / kRateHz);
    double state = normal(random);
    for (Index n = 0; n < count; ++n) {
      state = pole * state + std::sqrt(1.0 - pole * pole) * normal(random);
      x[n] += state;
    }
  }
  return x;
}

struct Colour {
  const char* name;
  Eigen::VectorXd (*noise)(Index, ComplexNoise&);
};

const std::array kColours = {
    Colour{"white", [](Index n, ComplexNoise& random) { return white(n, random); }},
    Colour{"1/f", [](Index n, ComplexNoise& random) { return flicker(n, random); }},
    Colour{"1/f^2, drift",
           [](Index n, ComplexNoise& random) -> Eigen::VectorXd {
             return log_uniform(random, 1.0, 100.0) * walk(n, random) + white(n, random);
           }},
    Colour{"slow, below 16 Hz",
           [](Index n, ComplexNoise& random) -> Eigen::VectorXd {
             return log_uniform(random, 1.0, 100.0) *
                        resonant(n, log_uniform(random, 1.0, 16.0), 0.7, random) +
                    white(n, random);
           }},
    Colour{"slow, narrow",
           [](Index n, ComplexNoise& random) -> Eigen::VectorXd {
             return log_uniform(random, 1.0, 100.0) * resonant(n, log_uniform(random, 0.5, 16.0),
                                                               log_uniform(random, 0.01, 0.3),
                                                               random) +
                    white(n, random);
           }},
    Colour{"resonant loop",
           [](Index n, ComplexNoise& random) -> Eigen::VectorXd {
             return log_uniform(random, 1.0, 30.0) * resonant(n, log_uniform(random, 16.0, 1000.0),
                                                              log_uniform(random, 0.005, 0.1),
                                                              random) +
                    white(n, random);
           }},
    Colour{"mixed",
           [](Index n, ComplexNoise& random) -> Eigen::VectorXd {
             return 10.0 * walk(n, random) + flicker(n, random) + 0.3 * white(n, random) +
                    log_uniform(random, 0.3, 10.0) *
                        resonant(n, log_uniform(random, 16.0, 1000.0), 0.02, random);
           }},
};

/// A spike, a bump or a step of some ms, somewhere in a period.
Eigen::VectorXd glitch_shape(ComplexNoise& random) {
  Eigen::VectorXd shape = Eigen::VectorXd::Zero(kPeriod);
  const double kind = random.uniform();
  const Index width =
      kind < 1.0 / 3.0 ? 1 : static_cast<Index>(kRateHz * log_uniform(random, 3e-4, 2e-2));
  const auto first = static_cast<Index>(random.uniform() * static_cast<double>(kPeriod - width));
  for (Index n = 0; n < width; ++n) {
    const double at = (static_cast<double>(n) + 0.5) / static_cast<double>(width);
    shape[first + n] = kind < 2.0 / 3.0 && width > 1 ? std::sin(std::numbers::pi * at) : 1.0;
  }
  return shape;
}

void add_glitch(Eigen::Ref<Eigen::MatrixXd> period, const Eigen::RowVectorXd& deviation,
                ComplexNoise& random) {
  const Eigen::VectorXd shape = glitch_shape(random);
  const double size = log_uniform(random, 5.0, 500.0);
  const Index only = random.uniform() < 0.5
                         ? static_cast<Index>(random.uniform() * static_cast<double>(period.cols()))
                         : -1;
  for (Index c = 0; c < period.cols(); ++c)
    if (only < 0 || c == only) period.col(c) += size * deviation[c] * shape;
}

/// |error|^2 over lines and channels, times the periods, summed up.
struct Errors {
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(kLines);
  void add(const FrfEstimate& frf, int periods) {
    squares += periods * (frf.response.array() - 1.0).abs2().colwise().sum().transpose();
  }
  double relative_to(const Errors& other) const {
    return std::sqrt((squares / other.squares).mean());
  }
  double absolute_to(const Errors& other) const {
    return std::sqrt(squares.sum() / other.squares.sum());
  }
};

struct Study {
  Arguments argument;
  std::uint64_t seed = argument(1, std::uint64_t{1});
  int wanted = argument(2, 1000);
  FrfMethod method = argument(3, 0) == 1 ? FrfMethod::lpm : FrfMethod::periodic;
  Index channels = argument(4, Index{3});
  int periods = argument(5, 0);
};

void study(const Colour& colour, const Study& s) {
  constexpr std::array kPeriods = {3, 4, 6, 10, 20};
  ComplexNoise random(s.seed);
  RealDft dft(kPeriod);
  FrfOptions plain{.method = s.method, .periods = PeriodChoice::unmarked, .threads = 1};
  FrfOptions check{.method = s.method, .threads = 1};
  Errors clean_plain, clean_check, glitch_plain, glitch_detection;
  int done = 0;
  std::size_t dropped = 0, spoilt = 0, found = 0, replaced = 0;
  for (std::size_t run = 0; done < s.wanted; ++run) {
    const int P = s.periods > 0 ? s.periods : kPeriods[run % kPeriods.size()];
    done += P;
    MemoryLog log;
    log.log_info.sample_rate_hz = kRateHz;
    log.log_info.period_samples = kPeriod;
    log.log_info.excitation = channels("a", 1, "N");
    log.log_info.actuators = channels("a", 1, "N");
    log.log_info.sensors = channels("z", s.channels, "m");
    Eigen::MatrixXcd R(1, kLines);
    std::vector<int> lines;
    for (int k = 0; k < kLines; ++k) {
      R(0, k) = random.phase();
      lines.push_back(k + 1);
    }
    const Eigen::MatrixXd period = synthesize(R, lines, dft);
    LogSamples record;
    record.actuators = period.replicate(P, 1);
    record.sensors = record.actuators.replicate(1, s.channels);
    Eigen::RowVectorXd deviation(s.channels);
    for (Index c = 0; c < s.channels; ++c) {
      const Eigen::VectorXd noise = colour.noise(record.sensors.rows(), random);
      const auto first = noise.head(kPeriod).array();
      deviation[c] = std::sqrt((first - first.mean()).square().mean());
      record.sensors.col(c) += noise;
    }
    log.append(0, 0, period, record);
    clean_plain.add(estimate_plant_frf({&log}, plain), P);
    const FrfEstimate clean = estimate_plant_frf({&log}, check);
    clean_check.add(clean, P);
    dropped += clean.dropped_periods.size() + clean.replaced_samples.size();
    if (std::getenv("PERIOD_STUDY_TELL") != nullptr)
      for (const auto& one : clean.dropped_periods)
        fmt::print("  run {} of {} periods: {} {}\n", run, P, one.period, one.reason);
    const std::size_t most = spoilt + static_cast<std::size_t>((P - 1) / 2);
    for (int p = 0; p < P; ++p) {
      if (random.uniform() > 0.05 || spoilt == most) continue;
      ++spoilt;
      add_glitch(log.records[0].sensors.middleRows(p * kPeriod, kPeriod), deviation, random);
    }
    glitch_plain.add(estimate_plant_frf({&log}, plain), P);
    const FrfEstimate glitched = estimate_plant_frf({&log}, check);
    glitch_detection.add(glitched, P);
    found += glitched.dropped_periods.size();
    replaced += glitched.replaced_samples.size();
  }
  fmt::print(
      "{:18} {:7} {:9.2f} {:8.3f} ({:.3f}) {:8} {:8} {:8} {:9.3f} ({:.3f}) {:9.1f} ({:.1f})\n",
      colour.name, done, 1e3 * static_cast<double>(dropped) / done,
      clean_check.relative_to(clean_plain), clean_check.absolute_to(clean_plain), spoilt, found,
      replaced, glitch_detection.relative_to(clean_plain),
      glitch_detection.absolute_to(clean_plain), glitch_plain.relative_to(clean_plain),
      glitch_plain.absolute_to(clean_plain));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const Study s{{argc, argv}};
  const std::string only = s.argument.word(6, "");
  fmt::print("{:18} {:>7} {:>9} {:>16} {:>8} {:>8} {:>8} {:>17} {:>15}\n", "noise", "periods",
             "dropped,‰", "clean error", "glitches", "dropped", "replaced", "glitched error",
             "undropped");
  for (const Colour& colour : kColours)
    if (std::string(colour.name).find(only) != std::string::npos) study(colour, s);
}

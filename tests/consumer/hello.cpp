#include <cstdio>
#include <stageid/estimation.hpp>

int main() {
  const stageid::Frf frf = stageid::estimate_frf(*stageid::open_log("run.slog"));
  const stageid::Fit fit = stageid::fit_model(frf);  // with the defaults of `stageid fit`
  for (const stageid::Submodel& mode : fit.model.submodels)
    if (mode.is_mode())
      std::printf("%.3f Hz, damping ratio %.5f\n", mode.natural_frequency_hz(),
                  mode.damping_ratio());
  return fit.trustworthy() ? 0 : 3;
}

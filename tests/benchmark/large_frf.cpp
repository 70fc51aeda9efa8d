// Writes a large FRF and its modes, for the peak of memory of the whole program:
//   large_frf frf.h5 modes.json [OUTPUTS INPUTS MODES SPACING_HZ]
//   /usr/bin/time -v stageid fit frf.h5 -o model.json --modes modes.json --delay SECONDS
// Prints the delay and the bytes of the data: response, variances and the weights that a fit makes.

#include <fmt/format.h>

#include <cstdlib>

#include "estimation/model/cmif.hpp"
#include "frf/file/frf_file.hpp"
#include "tests/support/stages/random_stage.hpp"

int main(int argc, char** argv) {
  using namespace stageid;
  if (argc != 3 && argc != 7) {
    fmt::print(stderr, "large_frf frf.h5 modes.json [OUTPUTS INPUTS MODES SPACING_HZ]\n");
    return EXIT_FAILURE;
  }
  test::RandomStageSpec spec;
  spec.outputs = argc > 3 ? std::atoi(argv[3]) : 100;
  spec.inputs = argc > 3 ? std::atoi(argv[4]) : 100;
  spec.least_modes = spec.most_modes = argc > 3 ? std::atoi(argv[5]) : 20;
  spec.line_spacing_hz = argc > 3 ? std::atof(argv[6]) : 0.99;
  test::RandomStage stage = test::draw_random_stage(2, spec);
  stage.exact.resize(0, 0);
  stage.variance.resize(0, 0);
  write_frf(argv[1], stage.frf);
  std::vector<ModeCandidate> modes;
  for (const Submodel& s : stage.truth.submodels)
    if (s.is_mode()) modes.push_back({s.natural_frequency_hz(), s.damping_ratio(), 1});
  write_modes(argv[2], modes);
  fmt::print("{} channels, {} lines, {} modes, delay {} s: {:.3f} GB\n", stage.frf.response.rows(),
             stage.frf.lines(), modes.size(), stage.delay_s,
             32e-9 * static_cast<double>(stage.frf.response.size()));
  return EXIT_SUCCESS;
}

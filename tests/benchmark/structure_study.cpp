// Whether a fit without any option finds plants whose structure it does not know: rigid body, damping, direct term,
// ranks, delays, number of modes (see VariedPlant). The reference is a fit of the true structure from the true
// parameters.
//
//   structure_study [plants = 20] [first seed = 1] [threads = 0: all] [-v: decisions of every plant]
//
// Prints one line per plant and a summary: found (cost within 1 % of the reference, exit code 0), told (exit code 3),
// wrong (the rest), and the processor time of a fit over that of a product of two 850 x 850 matrices.

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "estimation/request/fit_request.hpp"
#include "estimation/search/fit_additive_model.hpp"
#include "tests/support/stages/varied_plant.hpp"

namespace {

using namespace stageid;

double processor_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double product_s() {
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(850, 850);
  Eigen::MatrixXd C(850, 850);
  double least = 1.0;
  for (int i = 0; i < 5; ++i) {
    const double begin = processor_s();
    C.noalias() = A * A;
    least = std::min(least, processor_s() - begin);
  }
  return C(0, 0) == 0.0 ? 1.0 : least;
}

double cost_of_truth(const test::VariedPlant& plant, int threads) {
  FitOptions options = make_fit_setup({}, plant.frf).options;
  options.delay = plant.delay;
  options.delay_s = plant.truth.mean_delay_s();
  options.uncertainty = false;
  options.threads = threads;
  return fit_additive_model(plant.frf, plant.truth, options).model.fit.cost;
}

}  // namespace

int main(int argc, char** argv) {
  const int plants = argc > 1 ? std::atoi(argv[1]) : 20;
  const auto first = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const int threads = argc > 3 ? std::atoi(argv[3]) : 0;
  const bool verbose = argc > 4 && std::strcmp(argv[4], "-v") == 0;
  const double product = product_s();
  std::vector<double> products;
  int found = 0;
  int told = 0;
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(plants); ++seed) {
    const test::VariedPlant plant = test::draw_varied_plant(seed);
    FitRequest request;
    request.threads = threads;
    const double begin = processor_s();
    const FitResult fit = fit_model(plant.frf, request);
    products.push_back((processor_s() - begin) / product);
    const double excess = fit.model.fit.cost / cost_of_truth(plant, threads) - 1.0;
    const bool right = fit.trustworthy() && excess < 0.01;
    found += right ? 1 : 0;
    told += fit.trustworthy() ? 0 : 1;
    fmt::print("seed {}: {}, cost {:+.2g} %, {} of {} submodels, {:.0f} products; {}\n", seed,
               right               ? "found"
               : fit.trustworthy() ? "WRONG"
                                   : "told",
               100.0 * excess, fit.model.submodels.size(), plant.truth.submodels.size(),
               products.back(), plant.description());
    if (!right) fmt::print("  {}: {}\n", to_string(fit.status), fit.message);
    if (verbose || !right)
      for (const std::string& decision : fit.decisions) fmt::print("  | {}\n", decision);
    std::fflush(stdout);
  }
  if (products.empty()) return 2;
  std::sort(products.begin(), products.end());
  fmt::print("{} plants: {} found, {} told, {} wrong; products: median {:.0f}, most {:.0f}\n",
             plants, found, told, plants - found - told, products[products.size() / 2],
             products.back());
  return 0;
}

// Whether a fit without any option finds plants whose structure it does not know: rigid body, damping, direct term,
// ranks, delays, number of modes (see VariedPlant). The reference is a fit of the true structure from the true
// parameters.
//
//   structure_study [plants = 20] [first seed = 1] [threads = 0: all] [-v: decisions of every plant]
//                   [--dense: plants of many modes (dense_plant.hpp)] [--number: their number is given]
//
// Prints one line per plant and a summary: found (cost within 1 % of the reference, exit code 0), told (exit code 3),
// wrong (the rest), by how many of its standard deviations the delay is off, if it was estimated, and the processor
// time of a fit over that of a product of two 850 x 850 matrices.
// Dense plants without a given number are compared with the cost of the noise itself, because their weakest modes may
// be below it; those without noise are found with a relative error below 1e-11.

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/request/fit_request.hpp"
#include "tests/support/models/model_reference.hpp"
#include "tests/support/stages/dense_plant.hpp"
#include "tests/support/stages/varied_plant.hpp"

namespace {

using namespace stageid;

constexpr double kExact = 1e-11;  // relative error of a plant without noise
constexpr double kFar = 5.0;      // standard deviations that noise does not reach

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

/// Of the noise alone: that of the true response, computed by other code.
double cost_of_noise(const test::VariedPlant& plant) {
  const Eigen::MatrixXcd truth =
      test::reference_response(plant.truth, plant.frf.frequency_hz, plant.truth.hold);
  return 0.5 *
         ((plant.frf.response - truth).array().abs2() / plant.frf.noise_variance.array()).sum() /
         static_cast<double>(plant.frf.lines());
}

/// Largest error of the delay of a channel, in its standard deviations. Those of an input and of an output are taken as
/// uncorrelated.
double delay_error_deviations(const AdditiveModel& truth, const AdditiveModel& model) {
  const auto sums = [](const Eigen::VectorXd& inputs, const Eigen::VectorXd& outputs) {
    return Eigen::ArrayXXd((outputs.replicate(1, inputs.size()).rowwise() + inputs.transpose()));
  };
  const Eigen::ArrayXXd variance = sums(model.input_delay_std_s.array().square().matrix(),
                                        model.output_delay_std_s.array().square().matrix());
  if (variance.size() == 0) return 0.0;
  const Eigen::ArrayXXd error = sums(model.input_delay_s, model.output_delay_s) -
                                sums(truth.input_delay_s, truth.output_delay_s);
  return (error.abs() / variance.sqrt().max(1e-300)).maxCoeff();
}

struct Arguments {
  std::vector<double> numbers;
  bool verbose = false;
  bool dense = false;
  bool number = false;

  Arguments(int argc, char** argv) {
    for (int i = 1; i < argc; ++i) {
      if (std::strcmp(argv[i], "-v") == 0)
        verbose = true;
      else if (std::strcmp(argv[i], "--dense") == 0)
        dense = true;
      else if (std::strcmp(argv[i], "--number") == 0)
        number = true;
      else
        numbers.push_back(std::atof(argv[i]));
    }
  }
  int at(std::size_t i, int otherwise) const {
    return i < numbers.size() ? static_cast<int>(numbers[i]) : otherwise;
  }
};

}  // namespace

int main(int argc, char** argv) {
  const Arguments arguments(argc, argv);
  const int plants = arguments.at(0, 20);
  const auto first = static_cast<std::uint64_t>(arguments.at(1, 1));
  const int threads = arguments.at(2, 0);
  const double product = product_s();
  std::vector<double> products;
  int found = 0;
  int told = 0;
  int misdelayed = 0;
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(plants); ++seed) {
    const test::VariedPlant plant =
        arguments.dense ? test::draw_dense_plant(seed) : test::draw_varied_plant(seed);
    FitRequest request;
    request.threads = threads;
    if (arguments.number) request.modes = {ModesRequest::Kind::count, plant.modes(), {}};
    const double begin = processor_s();
    const FitResult fit = fit_model(plant.frf, request);
    products.push_back((processor_s() - begin) / product);
    const bool exact = plant.frf.noise_variance.size() == 0;
    const double reference = arguments.dense && !arguments.number && !exact
                                 ? cost_of_noise(plant)
                                 : cost_of_truth(plant, threads);
    const double excess = fit.model.fit.cost / reference - 1.0;
    const bool right =
        fit.trustworthy() && (exact ? fit.model.fit.relative_rms_error < kExact : excess < 0.01);
    found += right ? 1 : 0;
    told += fit.trustworthy() ? 0 : 1;
    const double late = fit.trustworthy() ? delay_error_deviations(plant.truth, fit.model) : 0.0;
    misdelayed += late > kFar ? 1 : 0;
    fmt::print(
        "seed {}: {}, cost {:+.2g} %, {} of {} submodels, {:.0f} products, delay {:.2g} deviations "
        "off; {}\n",
        seed,
        right               ? "found"
        : fit.trustworthy() ? "WRONG"
                            : "told",
        100.0 * excess, fit.model.submodels.size(), plant.truth.submodels.size(), products.back(),
        late, plant.description());
    if (!right) fmt::print("  {}: {}\n", to_string(fit.status()), fit.message());
    if (arguments.verbose || !right)
      for (const std::string& decision : fit.decisions) fmt::print("  | {}\n", decision);
    std::fflush(stdout);
  }
  if (products.empty()) return 2;
  std::sort(products.begin(), products.end());
  fmt::print(
      "{} plants: {} found, {} told, {} wrong, {} trusted with a delay more than {:.2g} deviations "
      "off; products: median {:.0f}, most {:.0f}\n",
      plants, found, told, plants - found - told, misdelayed, kFar, products[products.size() / 2],
      products.back());
  return 0;
}

#include "estimation/model/basis.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <stdexcept>
#include <string>

#include "tests/estimation/basis_cases.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_basis {

using namespace test::basis;

/// Where a function of a case is evaluated.
struct Place {
  const Case& c;
  double delay;
  Eigen::Index k;  ///< line
  double omega;
  int m;            ///< power of s
  double rounding;  ///< relative to the function
};

std::ostream& operator<<(std::ostream& stream, const Place& at) {
  return stream << at.c.name << ", s^" << at.m << " at " << lines_hz()[at.k] << " Hz, delay "
                << at.delay / kPeriod << " samples";
}

/// Calls check(place, basis) for every function of some cases, on every line, with delays in samples.
template <typename Check>
void for_each_value(const std::vector<Case>& all, HoldModel hold,
                    std::initializer_list<double> delays, const Check& check) {
  for (const Case& c : all)
    for (const double samples : delays) {
      const SubmodelBasis basis = evaluate(c, hold, samples * kPeriod);
      for (Eigen::Index k = 0; k < lines_hz().size(); ++k) {
        const double omega = 2.0 * std::numbers::pi * lines_hz()[k];
        for (int m = 0; m <= c.numerator_degree; ++m)
          check(
              Place{c, samples * kPeriod, k, omega, m, 50.0 * kEps * amplification(c, m, 1, omega)},
              basis);
      }
    }
}

Complex continuous(const Place& at) {
  return test::evaluate(at.c.function(at.m), kJ * at.omega) * std::exp(-kJ * at.omega * at.delay);
}

TEST(Basis, ContinuousFunctionsAreTheRationalOnesWithTheirDelay) {
  for_each_value(
      cases(), HoldModel::none, {0.0, 0.37, 2.0}, [](const Place& at, const SubmodelBasis& basis) {
        const Complex expected = continuous(at);
        EXPECT_LT(std::abs(basis.value(at.k, at.m) - expected), at.rounding * std::abs(expected))
            << at;
      });
}

TEST(Basis, TheExactHoldIsTheSampledStateSpaceAndTheAliasingSum) {
  constexpr int kTerms = 3000;
  double tightest = 1.0;
  for_each_value(
      cases(), HoldModel::exact, {0.0, 0.3, 1.3, 2.0, 7.25},
      [&](const Place& at, const SubmodelBasis& basis) {
        const test::RationalFunction f = at.c.function(at.m);
        const Complex value = basis.value(at.k, at.m);
        const Complex expected = test::sampled(f, at.omega, kPeriod, at.delay);
        EXPECT_LT(std::abs(value - expected), at.rounding * std::abs(expected)) << at;
        if (at.delay > 3.0 * kPeriod) return;
        const test::AliasingSum sum = test::aliasing_sum(f, at.omega, kPeriod, at.delay, kTerms);
        // The sum adds 2 terms of falling size: its own rounding is a few times that of one.
        EXPECT_LT(std::abs(value - sum.value), sum.tail + at.rounding * std::abs(sum.value)) << at;
        tightest = std::min(tightest, sum.tail / std::abs(sum.value));
      });
  // The bound must be worth something: at best it decides ten digits.
  EXPECT_LT(tightest, 1e-10);
}

TEST(Basis, TheDoubleIntegratorHasItsTextbookTransferFunction) {
  const Case c{"double integrator", 2, {}, 0};
  const SubmodelBasis basis = evaluate(c, HoldModel::exact, 0.0);
  for (Eigen::Index k = 0; k < lines_hz().size(); ++k) {
    const Complex z = std::polar(1.0, 2.0 * std::numbers::pi * lines_hz()[k] * kPeriod);
    const Complex expected = 0.5 * kPeriod * kPeriod * (z + 1.0) / ((z - 1.0) * (z - 1.0));
    const double cancellation = 1.0 / std::abs(z - 1.0);
    EXPECT_LT(std::abs(basis.value(k, 0) - expected),
              40.0 * kEps * cancellation * std::abs(expected));  // squared: each side loses twice
  }
}

// Errors of the hold levels "phase" and "sinc". For the double integrator, the ratio of the sampled response to the
// continuous one with half a sample of delay is cos(t/2) / sinc(t/2)^2, t = omega T. After division by the sinc, it is
// cos(t/2) / sinc(t/2)^3.
TEST(Basis, PhaseAndSincDifferFromExactByWhatIsKnown) {
  const Case c{"double integrator", 2, {}, 0};
  const Eigen::VectorXd hz{{200.0, 1000.0, 1500.0, 2000.0}};
  const double phase_ratio[] = {0.9993, 0.9830, 0.9600, 0.9244};
  const double sinc_ratio[] = {1.0000, 0.9993, 0.9965, 0.9882};
  const auto value = [&](HoldModel hold) {
    SubmodelBasis basis;
    evaluate_basis(HoldEquivalent({2.0 * std::numbers::pi * hz, kPeriod, hold}, 0.0), c.shape(),
                   Eigen::VectorXd(), {}, basis);
    return Eigen::VectorXcd(basis.value.re + Complex(0.0, 1.0) * basis.value.im);
  };
  const Eigen::VectorXcd exact = value(HoldModel::exact);
  const Eigen::VectorXcd phase = value(HoldModel::phase);
  const Eigen::VectorXcd sinc = value(HoldModel::sinc);
  for (Eigen::Index k = 0; k < hz.size(); ++k) {
    // No phase is left for a function whose continuous phase is -180 degrees.
    EXPECT_LT(std::abs(std::arg(exact[k] / phase[k])), 1e-9);
    EXPECT_LT(std::abs(std::arg(exact[k] / sinc[k])), 1e-9);
    EXPECT_NEAR(std::abs(exact[k] / phase[k]), phase_ratio[k], 5.1e-5) << hz[k];
    EXPECT_NEAR(std::abs(exact[k] / sinc[k]), sinc_ratio[k], 5.1e-5) << hz[k];
  }
}

TEST(Basis, PhaseAndSincAreTheRationalFunctionTimesTheHoldsPhaseAndMagnitude) {
  for (const HoldModel hold : {HoldModel::phase, HoldModel::sinc})
    for_each_value(cases(), hold, {1.3}, [&](const Place& at, const SubmodelBasis& basis) {
      if (at.m > 0) return;
      const Complex expected = test::through(at.c.function(0), hold, at.omega, kPeriod, at.delay);
      // (1 - e^{-sT}) / (sT) as the test writes it loses 1 / (omega T) of precision.
      const double tolerance = at.rounding + 50.0 * kEps / (at.omega * kPeriod);
      EXPECT_LT(std::abs(basis.value(at.k, 0) - expected), tolerance * std::abs(expected)) << at;
    });
}

/// f'(0) of f(h) and a bound of its error: central differences with h and 2h, extrapolated. The change by the
/// extrapolation is a generous bound of the remaining error, since the next term is smaller by (h / scale)^2.
struct Difference {
  Complex value;
  double error;
};
template <typename F>
Difference central(const F& f, double h, double rounding) {
  const auto slope = [&](double step) { return (f(step) - f(-step)) / (2.0 * step); };
  const Complex fine = slope(h);
  const Complex coarse = slope(2.0 * h);
  const Complex value = fine + (fine - coarse) / 3.0;
  return {value, 0.1 * std::abs(value - fine) + 2.0 * rounding / h};
}

TEST(Basis, TheGradientIsThatOfTheReference) {
  for (const HoldModel hold : {HoldModel::none, HoldModel::sinc, HoldModel::exact})
    for_each_value(cases(), hold, {1.3}, [&](const Place& at, const SubmodelBasis& basis) {
      const std::vector<double> a = at.c.a();
      for (std::size_t q = 1; q <= a.size(); ++q) {
        const auto reference = [&](double relative) {
          test::RationalFunction f = at.c.function(at.m);
          f.a[q - 1] *= 1.0 + relative;
          return test::through(f, hold, at.omega, kPeriod, at.delay);
        };
        // Sensitive where resonant: a step of 1e-5 moves a mode of 0.5 % by 1e-3 of its width.
        const Difference expected =
            central(reference, 1e-5, 0.08 * at.rounding * std::abs(reference(0.0)));
        const Complex derivative =
            basis.gradient(at.k, at.m * static_cast<int>(a.size()) + static_cast<int>(q) - 1) *
            a[q - 1];
        const double rounding = 50.0 * kEps *
                                amplification(at.c, at.m + static_cast<int>(q), 2, at.omega) *
                                std::abs(expected.value);
        EXPECT_LT(std::abs(derivative - expected.value), expected.error + rounding)
            << at << ", a_" << q << ", hold " << to_string(hold);
      }
    });
}

TEST(Basis, TheDelayDerivativeIsThatOfTheReference) {
  for (const HoldModel hold : {HoldModel::none, HoldModel::phase, HoldModel::exact})
    for_each_value(cases(), hold, {0.3, 1.3}, [&](const Place& at, const SubmodelBasis& basis) {
      const auto reference = [&](double of_a_sample) {
        return test::through(at.c.function(at.m), hold, at.omega, kPeriod,
                             at.delay + of_a_sample * kPeriod);
      };
      const double rounding = at.rounding * std::abs(reference(0.0));
      const Difference expected = central(reference, 1e-3, 0.08 * rounding);
      EXPECT_LT(std::abs(basis.delay(at.k, at.m) * kPeriod - expected.value),
                expected.error + rounding)
          << at << ", hold " << to_string(hold);
    });
}

// At a whole number of samples the response of a first-order function has a kink in the delay; the library uses the
// right side, where the fraction is zero.
TEST(Basis, AtWholeSamplesTheDelayDerivativeIsTheOneFromAbove) {
  const Case c = cases()[0];
  const double h = 1e-3;
  for (const double samples : {0.0, 2.0}) {
    const SubmodelBasis basis = evaluate(c, HoldModel::exact, samples * kPeriod);
    for (Eigen::Index k = 0; k < lines_hz().size(); ++k) {
      const double omega = 2.0 * std::numbers::pi * lines_hz()[k];
      const auto f = [&](double more) {
        return test::sampled(c.function(0), omega, kPeriod, (samples + more) * kPeriod);
      };
      // Third order: the remainder is h^3 / 4 of the fourth derivative, (lambda T)^4 < 1e-4 here.
      const Complex expected =
          (-11.0 * f(0.0) + 18.0 * f(h) - 9.0 * f(2.0 * h) + 2.0 * f(3.0 * h)) / (6.0 * h);
      EXPECT_LT(std::abs(basis.delay(k, 0) * kPeriod - expected),
                40.0 * kEps / h * std::abs(f(0.0)) + 1e-12 * std::abs(expected));
    }
  }
}

TEST(Basis, AWholeSampleMoreOfDelayIsOneShift) {
  for (const Case& c : cases()) {
    const SubmodelBasis once = evaluate(c, HoldModel::exact, 0.4 * kPeriod);
    const SubmodelBasis twice = evaluate(c, HoldModel::exact, 1.4 * kPeriod);
    for (Eigen::Index k = 0; k < lines_hz().size(); ++k) {
      const Complex shift = std::polar(1.0, -2.0 * std::numbers::pi * lines_hz()[k] * kPeriod);
      // 1.4 T / T and 0.4 T / T differ by rounding in their fraction, hence by the delay's slope.
      const double slack =
          4.0 * kEps * (kPeriod * std::abs(once.delay(k, 0)) + std::abs(once.value(k, 0)));
      EXPECT_LT(std::abs(twice.value(k, 0) - shift * once.value(k, 0)),
                slack * amplification(c, 0, 1, 2.0 * std::numbers::pi * lines_hz()[k]))
          << c.name;
    }
  }
}

TEST(Basis, ABiproperSubmodelKeepsItsConstant) {
  const Case constant{"constant", 0, {}, 0};
  const Case lead{"lead", 0, real_pole(200.0), 1};
  const Case mode{"mode with direct term", 0, mode_poles(600.0, 0.02), 2};
  const auto highest = [](const Place& at, const SubmodelBasis& basis, Complex expected) {
    if (at.m < at.c.numerator_degree) return;
    EXPECT_LT(std::abs(basis.value(at.k, at.m) - expected), at.rounding * std::abs(expected)) << at;
  };
  const auto delays = {0.0, 0.3, 1.0, 1.3, 2.0};
  for_each_value({constant, lead, mode}, HoldModel::exact, delays,
                 [&](const Place& at, const SubmodelBasis& basis) {
                   highest(at, basis,
                           test::sampled(at.c.function(at.m), at.omega, kPeriod, at.delay));
                 });
  for_each_value(
      {constant, lead, mode}, HoldModel::none, delays,
      [&](const Place& at, const SubmodelBasis& basis) { highest(at, basis, continuous(at)); });
}

TEST(Basis, AHeldConstantComesOutAtTheNextWholeSample) {
  for (const auto& [samples, shifts] :
       {std::pair{0.0, 0.0}, {0.3, 1.0}, {1.0, 1.0}, {1.3, 2.0}, {3.0, 3.0}}) {
    SubmodelBasis basis;
    evaluate_basis(HoldEquivalent(lines(HoldModel::exact), samples * kPeriod), {0, 0, 0},
                   Eigen::VectorXd(), {.gradient = true, .delay = true}, basis);
    for (Eigen::Index k = 0; k < lines_hz().size(); ++k) {
      const double angle = -2.0 * std::numbers::pi * lines_hz()[k] * kPeriod * shifts;
      EXPECT_LT(std::abs(basis.value(k, 0) - std::polar(1.0, angle)), 40.0 * kEps) << samples;
      EXPECT_EQ(basis.delay(k, 0), Complex(0.0));
    }
  }
}

TEST(Basis, WhatIsNotAskedForIsEmptyAndChangesNothing) {
  const HoldEquivalent through(lines(HoldModel::exact), 1e-5);
  for (const Case& c : cases()) {
    const std::vector<double> a = c.a();
    const Eigen::Map<const Eigen::VectorXd> coefficients(a.data(), std::ssize(a));
    SubmodelBasis all;
    evaluate_basis(through, c.shape(), coefficients, {.gradient = true, .delay = true}, all);
    SubmodelBasis bare;
    evaluate_basis(through, c.shape(), coefficients, {}, bare);
    EXPECT_EQ(all.value, bare.value) << c.name;
    EXPECT_EQ(bare.gradient.cols(), 0) << c.name;
    EXPECT_EQ(bare.delay.cols(), 0) << c.name;
    SubmodelBasis with_gradient;
    evaluate_basis(through, c.shape(), coefficients, {.gradient = true}, with_gradient);
    EXPECT_EQ(with_gradient.gradient, all.gradient) << c.name;
  }
}

TEST(Basis, RootsAreThoseThatThePolynomialWasBuiltFrom) {
  std::vector<Case> all = cases();
  all.push_back({"fifth order over three decades", 0,
                 mode_poles(20.0, 0.1) + mode_poles(2000.0, 0.02) + real_pole(300.0), 0});
  for (const Case& c : all) {
    const std::vector<double> a = c.a();
    std::vector<Complex> found = roots(Eigen::Map<const Eigen::VectorXd>(a.data(), std::ssize(a)));
    ASSERT_EQ(found.size(), c.poles.size()) << c.name;
    for (const Complex pole : c.poles) {
      const auto nearest = std::ranges::min_element(
          found, [&](Complex x, Complex y) { return std::abs(x - pole) < std::abs(y - pole); });
      // A root moves by eps |lambda| times its condition, prod |lambda| / |lambda - mu| < 1e3 here
      // (the lightly damped pair counts 1, three decades of spread the rest).
      EXPECT_LT(std::abs(*nearest - pole), 1e3 * kEps * std::abs(pole)) << c.name;
      found.erase(nearest);
    }
  }
}

TEST(Basis, NearlyEqualRealRootsDoNotCancel) {
  // The small root of 1e12-fold spread: -b + sqrt(b^2 - 4ac) would lose all digits.
  const Eigen::VectorXd a{{1.0 / 2e-3 + 1.0 / 2e9, 1.0 / (2e-3 * 2e9)}};
  std::vector<Complex> found = roots(a);
  std::ranges::sort(found, std::greater<>(), [](Complex x) { return x.real(); });
  EXPECT_NEAR(found[0].real(), -2e-3, 1e-15);
  EXPECT_NEAR(found[1].real(), -2e9, 1e-3);
}

TEST(Basis, RefusesWhatIsNotAModel) {
  const auto refusal = [](const SubmodelShape& shape, const Eigen::VectorXd& a) {
    return test::error_message<std::invalid_argument>([&] {
      SubmodelBasis out;
      evaluate_basis(HoldEquivalent(lines(HoldModel::none), 0.0), shape, a, {}, out);
    });
  };
  EXPECT_THAT(refusal({0, 1, 2}, Eigen::VectorXd{{1e-3}}), testing::HasSubstr("improper"));
  EXPECT_THAT(refusal({3, 0, 0}, {}), testing::HasSubstr("two integrators"));
}

TEST(Response, OfAModelIsTheSumOfItsSubmodelsThroughItsDelays) {
  AdditiveModel model;
  model.inputs = {{"a1", "a2", "a3"}, {"N", "N", "N"}};
  model.outputs = {{"z1", "z2"}, {"m", "m"}};
  model.sample_rate_hz = 1e4;
  model.input_delay_s = Eigen::VectorXd{{1e-5, 1.3e-4, 1e-5}};
  model.output_delay_s = Eigen::VectorXd{{0.0, 7e-5}};
  const Eigen::MatrixXd B0{{1.0, -2.0, 3.0}, {0.5, 4.0, -0.25}};
  const Eigen::MatrixXd B1{{1e-4, 2e-4, -1e-4}, {3e-4, 0.0, 1e-4}};
  const std::vector<double> a = test::mode_coefficients(700.0, 0.01);
  model.submodels = {{2, {1.0}, {1e5 * B0}, {}, {}}, {0, {1.0, a[0], a[1]}, {B0, B1}, {}, {}}};
  for (const HoldModel hold :
       {HoldModel::none, HoldModel::phase, HoldModel::sinc, HoldModel::exact}) {
    const Eigen::MatrixXcd P = response(model, lines_hz(), hold);
    const Eigen::MatrixXcd expected = test::reference_response(model, lines_hz(), hold);
    for (Eigen::Index k = 0; k < P.cols(); ++k)
      for (Eigen::Index c = 0; c < P.rows(); ++c)
        // The lowest line: 1 - z^-1 cancels to 1.6e-4, squared by nothing but itself.
        EXPECT_LT(std::abs(P(c, k) - expected(c, k)), 2e-11 * std::abs(expected(c, k)))
            << c << " at " << lines_hz()[k] << " Hz";
  }
}

TEST(Response, NeedsASampleRateForAHoldAndLinesBelowNyquist) {
  AdditiveModel model;
  model.inputs = {{"a"}, {"N"}};
  model.outputs = {{"z"}, {"m"}};
  model.submodels = {{2, {1.0}, {Eigen::MatrixXd::Ones(1, 1)}, {}, {}}};
  const auto refusal = [&](double hz, HoldModel hold) {
    return test::error_message<std::invalid_argument>(
        [&] { response(model, Eigen::VectorXd{{hz}}, hold); });
  };
  EXPECT_THAT(refusal(10.0, HoldModel::exact), testing::HasSubstr("sample rate"));
  EXPECT_THAT(refusal(10.0, HoldModel::phase), testing::HasSubstr("sample rate"));
  EXPECT_EQ(refusal(10.0, HoldModel::none), "no error");
  model.sample_rate_hz = 1000.0;
  EXPECT_THAT(refusal(501.0, HoldModel::exact), testing::HasSubstr("half the sample"));
  EXPECT_EQ(refusal(501.0, HoldModel::sinc), "no error");
}

}  // namespace stageid::test_basis

#include "tools/exchange/model/model_code.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "estimation/modal/sampled_state_space.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_model_code {

constexpr int kSamples = 400;

using Numbers = std::vector<long double>;

/// A x + B v.
Numbers sum_of(const Eigen::MatrixXd& A, const Numbers& x, const Eigen::MatrixXd& B,
               const Numbers& v) {
  Numbers out(A.rows());
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    for (Eigen::Index j = 0; j < A.cols(); ++j) out[i] += A(i, j) * x[j];
    for (Eigen::Index j = 0; j < B.cols(); ++j) out[i] += B(i, j) * v[j];
  }
  return out;
}

/// y of u, samples x channels, by the sums in sampled_state_space.hpp with whole matrices in long double.
Eigen::MatrixXd reference(const SampledStateSpace& model, const Eigen::MatrixXd& u) {
  const StateSpace& s = model.system;
  Numbers x(s.order());
  Eigen::MatrixXd y = Eigen::MatrixXd::Zero(u.rows(), s.C.rows());
  for (Eigen::Index n = 0; n < u.rows(); ++n) {
    Numbers v(s.B.cols());
    for (Eigen::Index j = 0; j < s.B.cols(); ++j) {
      const Eigen::Index from = n - model.input_delay_samples[j];
      if (from >= 0) v[j] = u(from, j);
    }
    const Numbers out = sum_of(s.C, x, s.D, v);
    for (Eigen::Index i = 0; i < y.cols(); ++i) {
      const Eigen::Index to = n + model.output_delay_samples[i];
      if (to < y.rows()) y(to, i) = static_cast<double>(out[i]);
    }
    x = sum_of(s.A, x, s.B, v);
  }
  return y;
}

/// The same by the code, compiled with all warnings as errors.
Eigen::MatrixXd compiled(const AdditiveModel& model, const Eigen::MatrixXd& u) {
  const test::TemporaryDirectory directory;
  write_text_file(directory / "plant.h", model_code(model, "plant"));
  std::ofstream input(directory / "u.txt");
  for (const double value : u.transpose().reshaped()) input << fmt::format("{:a}\n", value);
  input.close();
  write_text_file(directory / "main.c", R"(#include "plant.h"
#include "plant.h" /* twice is as good as once */
#include <stdio.h>
int main(void) {
  plant_state state;
  double u[plant_inputs];
  double y[plant_outputs];
  for (int run = 0; run < 2; ++run) { /* a reset forgets the first run */
    plant_reset(&state);
    rewind(stdin);
    for (int n = 0; n < 400; ++n) {
      for (int j = 0; j < plant_inputs; ++j)
        if (scanf("%la", &u[j]) != 1) return 1;
      plant_step(&state, u, y);
      for (int i = 0; run == 1 && i < plant_outputs; ++i) printf("%a\n", y[i]);
    }
  }
  return plant_sample_rate_hz > 0.0 ? 0 : 1;
}
)");
  const std::string command = "cd '" + directory.path().string() +
                              "' && cc -std=c99 -pedantic -Wall -Wextra -Wconversion -Werror -O2 "
                              "-o plant main.c > log 2>&1 "
                              "&& c++ -std=c++17 -Wall -Wextra -Werror -fsyntax-only -x c++ main.c "
                              ">> log 2>&1 && ./plant < u.txt > y.txt";
  const int status = std::system(command.c_str());
  EXPECT_EQ(status, 0) << read_whole_file(directory / "log");
  Eigen::MatrixXd y(u.rows(), model.n_outputs());
  std::ifstream output(directory / "y.txt");
  std::string word;
  for (Eigen::Index n = 0; n < y.rows(); ++n)
    for (Eigen::Index i = 0; i < y.cols() && (output >> word); ++i)
      y(n, i) = std::strtod(word.c_str(), nullptr);
  return y;
}

AdditiveModel plant_of(const Eigen::VectorXd& input_samples,
                       const Eigen::VectorXd& output_samples) {
  test::RandomNumbers random(31);
  AdditiveModel model;
  model.sample_rate_hz = 1000.0;
  model.hold = HoldModel::exact;
  for (Eigen::Index j = 0; j < input_samples.size(); ++j) {
    model.inputs.names.push_back(fmt::format("a{} */ \\", j));  // what would end the comment
    model.inputs.units.push_back("N");
  }
  for (Eigen::Index i = 0; i < output_samples.size(); ++i) {
    model.outputs.names.push_back(fmt::format("y{}", i));
    model.outputs.units.push_back("m");
  }
  model.input_delay_s = 1e-3 * input_samples;
  model.output_delay_s = 1e-3 * output_samples;
  const auto numerator = [&] {
    Eigen::MatrixXd B(output_samples.size(), input_samples.size());
    for (double& entry : B.reshaped()) entry = random.normal();
    return B;
  };
  Submodel body;
  body.integrators = 2;
  body.numerator = {numerator()};
  Submodel lag;
  lag.denominator = {1.0, 2e-3};
  lag.numerator = {1e-3 * numerator()};
  model.submodels = {body, lag};
  for (const double hz : {41.0, 130.0}) {
    const double omega = 2.0 * M_PI * hz;
    Submodel mode;
    mode.denominator = {1.0, 0.02 / omega, 1.0 / (omega * omega)};
    mode.numerator = {1e-4 * numerator(), 1e-8 * numerator()};
    model.submodels.push_back(mode);
  }
  Submodel direct;
  direct.numerator = {1e-5 * numerator()};
  model.submodels.push_back(direct);
  return model;
}

void expect_equal(const AdditiveModel& model) {
  test::RandomNumbers random(32);
  Eigen::MatrixXd u(kSamples, model.n_inputs());
  for (double& value : u.reshaped()) value = random.normal();
  const Eigen::MatrixXd exact = reference(sampled_state_space(model), u);
  const Eigen::MatrixXd y = compiled(model, u);
  for (Eigen::Index i = 0; i < y.cols(); ++i) {
    const double error =
        (y.col(i) - exact.col(i)).cwiseAbs().maxCoeff() / exact.col(i).cwiseAbs().maxCoeff();
    EXPECT_LT(error, 1e-12) << "output " << i;
    testing::Test::RecordProperty(fmt::format("error_{}", i), fmt::format("{:.2g}", error));
  }
}

TEST(ModelCode, EqualsTheSampledStateSpaceWithOneDelay) {
  expect_equal(plant_of(Eigen::VectorXd::Constant(3, 1.4), Eigen::VectorXd::Zero(2)));
}

TEST(ModelCode, EqualsItWithADelayPerChannelAndDelayStates) {
  const AdditiveModel model =
      plant_of(Eigen::VectorXd{{0.3, 2.9, 1.0}}, Eigen::VectorXd{{0.0, 1.6, 3.2, 0.5}});
  const SampledStateSpace sampled = sampled_state_space(model);
  ASSERT_EQ(sampled.system.blocks.back().submodel, -1);  // a delay state
  ASSERT_GT(sampled.output_delay_samples.maxCoeff(), 0);
  ASSERT_GT(sampled.input_delay_samples.maxCoeff(), 0);
  expect_equal(model);
}

TEST(ModelCode, WorksForAConstantAndForOneState) {
  AdditiveModel model = plant_of(Eigen::VectorXd{{1.0}}, Eigen::VectorXd{{0.0}});
  const std::vector<Submodel> all = model.submodels;
  model.submodels = {all.back()};
  expect_equal(model);
  model.submodels = {all[1]};
  expect_equal(model);
}

TEST(ModelCode, RefusesWhatCIsNotAbleToName) {
  const AdditiveModel model = plant_of(Eigen::VectorXd{{1.0}}, Eigen::VectorXd{{0.0}});
  for (const char* name : {"", "2nd", "my-plant", "mod\xc3\xa8le"})
    EXPECT_THROW(model_code(model, name), std::invalid_argument) << name;
  AdditiveModel early = plant_of(Eigen::VectorXd{{-1.0}}, Eigen::VectorXd{{0.0}});
  EXPECT_THROW(model_code(early, "plant"), std::invalid_argument);
  early.sample_rate_hz = 0.0;
  EXPECT_THROW(model_code(early, "plant"), std::invalid_argument);
}

}  // namespace stageid::test_model_code

#include "estimation/fit_problem.hpp"

#include <atomic>
#include <map>
#include <thread>

namespace stageid {

Eigen::ArrayXd LineVariance::channel(Eigen::Index c) const {
  return matrix->row(c).transpose().array() / divisor;
}

Eigen::VectorXd FitProblem::weights(Eigen::Index channel) const {
  Eigen::VectorXd w = W->row(channel).transpose();
  if (middle) w = w.cwiseProduct(w).array() * middle->channel(channel);
  return w;
}

Eigen::Index FitProblem::functions() const noexcept {
  Eigen::Index n = 0;
  for (const SubmodelShape& shape : shapes) n += shape.functions();
  return n;
}

Eigen::Index FitProblem::denominators() const noexcept {
  Eigen::Index n = 0;
  for (const SubmodelShape& shape : shapes) n += shape.order;
  return n;
}

Eigen::Index FitProblem::delays() const noexcept {
  switch (delay) {
    case DelayModel::fixed:
      return 0;
    case DelayModel::estimate:
      return 1;
    case DelayModel::per_channel:
      return n_outputs + n_inputs - 1;
  }
  return 0;
}

std::vector<DerivativeColumn> derivative_columns(const FitProblem& problem) {
  std::vector<DerivativeColumn> columns;
  Eigen::Index function = 0;
  Eigen::Index parameter = 0;
  for (const SubmodelShape& shape : problem.shapes) {
    for (int m = 0; m < shape.functions(); ++m)
      for (int q = 0; q < shape.order; ++q) columns.push_back({function + m, parameter + q});
    function += shape.functions();
    parameter += shape.order;
  }
  return columns;
}

std::vector<Eigen::Index> delay_parameters(const FitProblem& problem, Eigen::Index channel) {
  const Eigen::Index first = problem.denominators();
  if (problem.delay == DelayModel::estimate) return {first};
  if (problem.delay == DelayModel::fixed) return {};
  const Eigen::Index y = channel % problem.n_outputs;
  std::vector<Eigen::Index> out{first + channel / problem.n_outputs};
  if (y + 1 < problem.n_outputs) out.push_back(first + problem.n_inputs + y);
  return out;
}

FitParameters stepped(const FitProblem& problem, const FitParameters& beta,
                      const Eigen::Ref<const Eigen::VectorXd>& step) {
  FitParameters out = beta;
  Eigen::Index p = 0;
  for (Eigen::VectorXd& a : out.a) {
    a += step.segment(p, a.size());
    p += a.size();
  }
  if (problem.delay == DelayModel::estimate) {
    out.input_delay_s.array() += step[p];
  } else if (problem.delay == DelayModel::per_channel) {
    out.input_delay_s += step.segment(p, problem.n_inputs);
    out.output_delay_s.head(problem.n_outputs - 1) += step.tail(problem.n_outputs - 1);
  }
  return out;
}

std::vector<BasisGroup> evaluate_groups(const FitProblem& problem, const FitParameters& beta,
                                        bool with_derivatives) {
  std::map<double, std::vector<Eigen::Index>> members;
  for (Eigen::Index c = 0; c < problem.channels(); ++c) {
    const double delay =
        beta.input_delay_s[c / problem.n_outputs] + beta.output_delay_s[c % problem.n_outputs];
    members[delay].push_back(c);
  }
  std::vector<BasisGroup> groups;
  for (auto& [delay, channels] : members) {
    BasisGroup group;
    group.delay_s = delay;
    group.channels = std::move(channels);
    groups.push_back(std::move(group));
  }

  const Eigen::Index N = problem.size();
  const auto n_d = static_cast<Eigen::Index>(derivative_columns(problem).size());
  parallel_tasks(static_cast<int>(groups.size()), problem.threads, [&](int g) {
    BasisGroup& group = groups[static_cast<std::size_t>(g)];
    const LineOperator through(problem.lines, group.delay_s);
    if (static_cast<Eigen::Index>(group.channels.size()) >= kFewChannels)
      group.fractions = fraction_columns(through, problem.lines.omega_rad_s.maxCoeff(),
                                         problem.shapes, beta.a, with_derivatives);
    const WantedBasis wanted{with_derivatives, with_derivatives && problem.delays() > 0};
    group.F_re.resize(N, problem.functions());
    group.F_im.resize(N, problem.functions());
    if (wanted.gradient) {
      group.D_re.resize(N, n_d);
      group.D_im.resize(N, n_d);
    }
    if (wanted.delay) {
      group.T_re.resize(N, problem.functions());
      group.T_im.resize(N, problem.functions());
    }
    SubmodelBasis basis;
    Eigen::Index f = 0;
    Eigen::Index d = 0;
    for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
      evaluate_basis(through, problem.shapes[i], beta.a[i], wanted, basis);
      const Eigen::Index functions = basis.value.cols();
      group.F_re.middleCols(f, functions) = basis.value.re;
      group.F_im.middleCols(f, functions) = basis.value.im;
      const Eigen::Index gradients = basis.gradient.cols();
      if (gradients > 0) {
        group.D_re.middleCols(d, gradients) = basis.gradient.re;
        group.D_im.middleCols(d, gradients) = basis.gradient.im;
      }
      if (wanted.delay) {
        group.T_re.middleCols(f, functions) = basis.delay.re;
        group.T_im.middleCols(f, functions) = basis.delay.im;
      }
      f += functions;
      d += gradients;
    }
  });
  return groups;
}

void parallel_tasks(int count, int threads, const std::function<void(int)>& task) {
  if (threads <= 1 || count <= 1) {
    for (int i = 0; i < count; ++i) task(i);
    return;
  }
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int i = next++; i < count; i = next++) task(i);
  };
  std::vector<std::jthread> helpers;
  for (int t = 1; t < std::min(threads, count); ++t) helpers.emplace_back(work);
  work();
}

}  // namespace stageid

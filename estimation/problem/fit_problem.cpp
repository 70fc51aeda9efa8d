#include "estimation/problem/fit_problem.hpp"

#include <algorithm>
#include <span>

#include "estimation/problem/search_limit.hpp"

namespace stageid {

std::vector<DataRange> ranges_of(Eigen::Index count, Eigen::Index most) {
  std::vector<DataRange> out;
  for (Eigen::Index i = 0; i < count; i += most) out.push_back({i, std::min(most, count - i)});
  return out;
}

Workers FitOptions::workers() const { return {threads, team}; }

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

bool FitProblem::is_held(Eigen::Index global) const noexcept {
  return std::ranges::find(held, global) != held.end();
}

std::vector<DerivativeColumn> derivative_columns(const FitProblem& problem) {
  std::vector<DerivativeColumn> columns;
  Eigen::Index function = 0;
  Eigen::Index parameter = 0;
  for (const SubmodelShape& shape : problem.shapes) {
    for (int m = 0; m < shape.functions(); ++m)
      for (int q = 0; q < shape.order; ++q)
        if (!problem.is_held(parameter + q)) columns.push_back({function + m, parameter + q});
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

namespace {

constexpr std::size_t kSubmodelsATask = 32;
constexpr std::size_t kGroupsAtOnce = 16;

/// First columns of a submodel.
struct SubmodelPlace {
  Eigen::Index function = 0;
  Eigen::Index parameter = 0;
  Eigen::Index derivative = 0;  // see DerivativeColumn
};

std::vector<SubmodelPlace> submodel_places(const FitProblem& problem) {
  std::vector<SubmodelPlace> out;
  SubmodelPlace next;
  for (const SubmodelShape& shape : problem.shapes) {
    out.push_back(next);
    next.function += shape.functions();
    for (int q = 0; q < shape.order; ++q, ++next.parameter)
      if (!problem.is_held(next.parameter)) next.derivative += shape.functions();
  }
  return out;
}

void resize(const FitProblem& problem, WantedBasis wanted, BasisGroup& group) {
  const auto derivatives = static_cast<Eigen::Index>(derivative_columns(problem).size());
  group.F.resize(problem.size(), problem.functions());
  if (wanted.gradient) group.D.resize(problem.size(), derivatives);
  if (wanted.delay) group.T.resize(problem.size(), problem.functions());
}

void evaluate_submodel(const FitProblem& problem, const HoldEquivalent& through,
                       const FitParameters& beta, std::size_t i, const SubmodelPlace& place,
                       WantedBasis wanted, SubmodelBasis& basis, BasisGroup& group) {
  evaluate_basis(through, problem.shapes[i], beta.a[i], wanted, basis);
  const Eigen::Index functions = basis.value.cols();
  group.F.re.middleCols(place.function, functions) = basis.value.re;
  group.F.im.middleCols(place.function, functions) = basis.value.im;
  Eigen::Index d = place.derivative;
  for (Eigen::Index c = 0; c < basis.gradient.cols(); ++c) {
    if (problem.is_held(place.parameter + c % problem.shapes[i].order)) continue;
    group.D.re.col(d) = basis.gradient.re.col(c);
    group.D.im.col(d++) = basis.gradient.im.col(c);
  }
  if (!wanted.delay) return;
  group.T.re.middleCols(place.function, functions) = basis.delay.re;
  group.T.im.middleCols(place.function, functions) = basis.delay.im;
}

/// The number of products of the functions grows with their square.
void add_work(const FitProblem& problem, bool with_derivatives) {
  auto columns = static_cast<double>(problem.functions());
  if (with_derivatives) columns += static_cast<double>(derivative_columns(problem).size());
  problem.limit->add(static_cast<double>(problem.size()), static_cast<double>(problem.channels()),
                     columns);
}

/// The groups of all channels, without their functions.
std::vector<BasisGroup> unevaluated_groups(const FitParameters& beta) {
  std::vector<BasisGroup> groups;
  const Eigen::Index outputs = beta.output_delay_s.size();
  for (auto& [delay, channels] : channels_by_delay(beta.input_delay_s, beta.output_delay_s, outputs,
                                                   0, beta.input_delay_s.size() * outputs)) {
    groups.emplace_back().delay_s = delay;
    groups.back().channels = std::move(channels);
  }
  return groups;
}

/// @param base see fraction_base(); if empty, it is computed
void evaluate(const FitProblem& problem, const FitParameters& beta, bool with_derivatives,
              std::span<BasisGroup> groups, std::optional<SharedMatrix<Eigen::MatrixXd>>& base) {
  const WantedBasis wanted{with_derivatives, with_derivatives && problem.delays() > 0};
  const std::vector<SubmodelPlace> places = submodel_places(problem);
  std::vector<std::optional<HoldEquivalent>> through(groups.size());
  for_each_task(problem.threads, static_cast<int>(groups.size()), [&](int g) {
    BasisGroup& group = groups[g];
    through[g].emplace(problem.lines, group.delay_s);
    resize(problem, wanted, group);
    group.fractions = fraction_columns(*through[g], problem.lines.omega_rad_s.maxCoeff(),
                                       problem.shapes, beta.a, with_derivatives, problem.held);
  });
  if (!base) base = fraction_base(*through[0], groups[0].fractions.lambda, with_derivatives);
  for (BasisGroup& group : groups) group.fractions.base = *base;
  const std::size_t parts = (places.size() + kSubmodelsATask - 1) / kSubmodelsATask;
  for_each_task(problem.threads, static_cast<int>(groups.size() * parts), [&](int task) {
    const std::size_t g = static_cast<std::size_t>(task) / parts;
    const std::size_t first = static_cast<std::size_t>(task) % parts * kSubmodelsATask;
    SubmodelBasis basis;
    for (std::size_t i = first; i < std::min(places.size(), first + kSubmodelsATask); ++i)
      evaluate_submodel(problem, *through[g], beta, i, places[i], wanted, basis, groups[g]);
  });
}

}  // namespace

std::vector<BasisGroup> evaluate_groups(const FitProblem& problem, const FitParameters& beta,
                                        bool with_derivatives) {
  if (problem.limit) add_work(problem, with_derivatives);
  std::vector<BasisGroup> groups = unevaluated_groups(beta);
  std::optional<SharedMatrix<Eigen::MatrixXd>> base;
  evaluate(problem, beta, with_derivatives, groups, base);
  return groups;
}

BasisGroups::BasisGroups(const FitProblem& problem, const FitParameters& beta,
                         bool with_derivatives)
    : problem_(&problem), beta_(&beta), with_derivatives_(with_derivatives) {}

void BasisGroups::for_each(const std::function<void(const BasisGroup&)>& visit) const {
  if (evaluated_ != nullptr) {
    std::ranges::for_each(*evaluated_, visit);
    return;
  }
  if (problem_->limit) add_work(*problem_, with_derivatives_);
  std::vector<BasisGroup> groups = unevaluated_groups(*beta_);
  std::optional<SharedMatrix<Eigen::MatrixXd>> base;
  for (std::size_t first = 0; first < groups.size(); first += kGroupsAtOnce) {
    const std::size_t count = std::min(kGroupsAtOnce, groups.size() - first);
    const std::span<BasisGroup> some = std::span(groups).subspan(first, count);
    evaluate(*problem_, *beta_, with_derivatives_, some, base);
    std::ranges::for_each(some, visit);
    for (BasisGroup& group : some) group = {};  // assigned by move: a copy would keep memory
  }
}

std::vector<const BasisGroup*> groups_of_channels(const FitProblem& problem,
                                                  const std::vector<BasisGroup>& groups) {
  std::vector<const BasisGroup*> out(problem.channels());
  for (const BasisGroup& group : groups)
    for (const Eigen::Index c : group.channels) out[c] = &group;
  return out;
}

bool has_no_weight(const FitProblem& problem, Eigen::Index channel) {
  return !(problem.W->row(channel).maxCoeff() > 0.0);
}

double weighted_power(const FrfEstimate& frf, const Eigen::MatrixXd& weights) {
  return number_over_tiles(*frf.team, weights.rows(), [&](DataRange tile) {
    const Eigen::MatrixXd W = weights.middleRows(tile.first, tile.count);
    const Eigen::MatrixXcd G = frf.response.middleRows(tile.first, tile.count);
    return (W.array() * G.cwiseAbs2().array()).sum();
  });
}

double residual_per_degree(const FitProblem& problem, double cost, Eigen::Index parameters) {
  const auto weighted = static_cast<Eigen::Index>(
      number_over_tiles(*problem.team, problem.channels(), [&](DataRange tile) {
        Eigen::Index count = 0;
        for (Eigen::Index c = tile.first; c < tile.first + tile.count; ++c)
          count += has_no_weight(problem, c) ? 0 : 1;
        return count;
      }));
  const Eigen::Index without = (problem.channels() - weighted) * problem.functions();
  const double data = static_cast<double>(problem.size() * weighted);
  return 2.0 * static_cast<double>(problem.size()) * cost /
         std::max(data - 0.5 * static_cast<double>(parameters - without), 1.0);
}

}  // namespace stageid

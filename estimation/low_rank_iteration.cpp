#include "estimation/low_rank_iteration.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimation/arrow_system.hpp"
#include "estimation/pole_bounds.hpp"

namespace stageid {
namespace {

/// What the free parameters, globals first, do to the numerators of one channel.
struct Entry {
  Eigen::Index function;
  Eigen::Index parameter;
  double value;
};

class LowRankIteration {
 public:
  LowRankIteration(const FitProblem& problem, FitParameters& beta, const FitOptions& options)
      : problem_(problem), beta_(beta), options_(options), bounds_(problem, beta) {
    Eigen::Index function = 0;
    Eigen::Index denominator = 0;
    Eigen::Index parameter = problem.globals();
    for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
      const SubmodelShape& shape = problem.shapes[i];
      const int rank = rank_of(shape, beta.a[i]);
      ranks_.push_back(rank);
      Part part{ResidueForm(shape, rank, problem.n_outputs, problem.n_inputs), function,
                denominator, parameter};
      function += shape.functions();
      denominator += shape.order;
      parameter += part.form.size();
      parts_.push_back(std::move(part));
    }
    size_ = parameter;
  }

  /// A mode beside the lines stands for all that the plant does there: its residue stays free.
  int rank_of(const SubmodelShape& shape, const Eigen::VectorXd& a) const {
    if (shape.integrators > 0) return options_.rigid_body_rank;
    if (shape.order != 2 || !(a[1] > 0.0)) return 0;
    const double omega = 1.0 / std::sqrt(a[1]);
    const Eigen::VectorXd& lines = problem_.lines.omega_rad_s;
    return omega > lines.minCoeff() && omega < lines.maxCoeff() ? options_.residue_rank : 0;
  }

  LowRankResult run(bool likelihood) {
    LowRankResult out;
    project();
    result_.cost.push_back(result_.E.cost);
    while (iterate_once() && result_.iterations < options_.max_iterations) {
    }
    if (result_.message.empty())
      end(FitStatus::iteration_limit,
          fmt::format("residues of given rank: stopped after {} iterations, scaled gradient {:.2g}",
                      result_.iterations, gradient_));
    if (options_.uncertainty && result_.status != FitStatus::singular) fill(out, likelihood);
    result_.frozen = frozen_;
    out.parameters = size_;
    out.ranks = ranks_;
    out.iteration = std::move(result_);
    return out;
  }

 private:
  struct Part {
    ResidueForm form;
    Eigen::Index first_function;
    Eigen::Index first_denominator;
    Eigen::Index first_parameter;
  };

  /// The unconstrained numerators, each weighted by its inverse variance.
  void project() {
    const std::vector<BasisGroup> groups = evaluate_groups(problem_, beta_, true);
    const ArrowSystem system(problem_, beta_, groups, FitMethod::gn);
    Eigen::MatrixXd weight(problem_.channels(), problem_.functions());
    const Eigen::MatrixXd unit =
        Eigen::MatrixXd::Identity(problem_.functions(), problem_.functions());
    for (Eigen::Index c = 0; c < problem_.channels(); ++c) {
      Eigen::MatrixXd inverse = unit;
      solve_scaled(system.channels()[static_cast<std::size_t>(c)].bb, unit, inverse);
      weight.row(c) = inverse.diagonal().cwiseMax(1e-300).cwiseInverse().transpose();
    }
    weight /= weight.maxCoeff();
    std::size_t i = 0;
    for (Part& part : parts_) {
      const Eigen::VectorXd& a = beta_.a[i++];
      const Eigen::Index n = problem_.shapes[i - 1].functions();
      part.form.project(
          a, beta_.B.middleCols(part.first_function, n),
          weight.col(part.first_function).reshaped(problem_.n_outputs, problem_.n_inputs));
    }
    write_numerators(parts_, beta_);
    result_.E = residual(problem_, groups, beta_.B);
  }

  void write_numerators(const std::vector<Part>& parts, FitParameters& beta) const {
    for (std::size_t i = 0; i < parts.size(); ++i)
      beta.B.middleCols(parts[i].first_function, problem_.shapes[i].functions()) =
          parts[i].form.numerators(beta.a[i]);
  }

  void channel_entries(Eigen::Index channel, std::vector<Entry>& out) const {
    out.clear();
    std::vector<ResidueForm::Derivative> own;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const Part& part = parts_[i];
      part.form.derivatives(beta_.a[i], channel, own);
      for (const auto& [function, parameter, value] : own)
        out.push_back({part.first_function + function,
                       parameter >= 0 ? part.first_parameter + parameter
                                      : part.first_denominator - 1 - parameter,
                       value});
    }
  }

  /// Normal matrix and gradient of the free parameters from those of the unconstrained ones.
  void reduce(const ArrowSystem& system) {
    const Eigen::Index globals = problem_.globals();
    N_.setZero(size_, size_);
    g_.setZero(size_);
    N_.topLeftCorner(globals, globals) = system.M_globals();
    g_.head(globals) = system.e_globals();
    std::vector<Entry> entries;
    for (Eigen::Index c = 0; c < problem_.channels(); ++c) {
      const ArrowSystem::Channel& channel = system.channels()[static_cast<std::size_t>(c)];
      channel_entries(c, entries);
      for (const Entry& t : entries) {
        g_[t.parameter] += t.value * channel.e[t.function];
        N_.col(t.parameter).head(globals) += t.value * channel.ab.col(t.function);
        N_.row(t.parameter).head(globals) += t.value * channel.ba.row(t.function);
        for (const Entry& o : entries)
          N_(t.parameter, o.parameter) += t.value * channel.bb(t.function, o.function) * o.value;
      }
    }
  }

  Eigen::VectorXd solve(double damping) const {
    const Eigen::VectorXd scale = N_.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = scale.asDiagonal() * N_ * scale.asDiagonal();
    scaled.diagonal().array() += damping + 1e-13;
    Eigen::VectorXd rhs = scale.cwiseProduct(g_);
    hold_unknowns(frozen_, scaled);
    for (const Eigen::Index i : frozen_) rhs[i] = 0.0;
    return scale.cwiseProduct(scaled.ldlt().solve(rhs));
  }

  bool end(FitStatus status, std::string message) {
    result_.status = status;
    result_.message = std::move(message);
    return false;
  }

  /// @returns whether to go on.
  bool iterate_once() {
    const std::vector<BasisGroup> groups = evaluate_groups(problem_, beta_, true);
    const ArrowSystem system(problem_, beta_, groups, FitMethod::gn);
    reduce(system);
    if (!N_.allFinite()) return end(FitStatus::singular, "the residue factors are not determined");
    frozen_ = bounds_.leaning(beta_, g_.head(problem_.globals()));
    const double squares = 2.0 * static_cast<double>(problem_.size()) * result_.E.cost;
    gradient_ = 0.0;
    for (Eigen::Index i = 0; i < size_; ++i)
      if (std::find(frozen_.begin(), frozen_.end(), i) == frozen_.end())
        gradient_ =
            std::max(gradient_, std::abs(g_[i]) / std::sqrt(std::max(N_(i, i) * squares, 1e-300)));
    const double data = static_cast<double>(problem_.size() * problem_.channels());
    const double deviations = std::sqrt(std::abs(solve(0.0).dot(g_)) * data / squares);
    if (gradient_ < options_.gradient_tolerance || deviations < options_.deviation_tolerance)
      return end(FitStatus::gradient_small,
                 fmt::format("residues of given rank: within {:.1g} standard deviations of the "
                             "first-order condition, scaled gradient {:.2g}",
                             deviations, gradient_));
    if (attempt()) return true;
    if (deviations < kRoundingDeviations)
      return end(FitStatus::step_small,
                 fmt::format("residues of given rank: the cost is at rounding, within {:.1g} "
                             "standard deviations of the first-order condition",
                             deviations));
    return end(
        FitStatus::cost_stalled,
        fmt::format("residues of given rank: no step lowers the cost; scaled gradient {:.2g}",
                    gradient_));
  }

  bool attempt() {
    for (; levenberg_ <= kLargestLevenberg; levenberg_ = std::max(10.0 * levenberg_, 1e-4)) {
      const Eigen::VectorXd step = solve(levenberg_);
      if (!step.allFinite()) continue;
      FitParameters trial = stepped(problem_, beta_, step.head(problem_.globals()));
      if (!bounds_.stabilize(beta_, trial)) continue;
      std::vector<Part> parts = parts_;
      for (Part& part : parts) part.form.step(step.segment(part.first_parameter, part.form.size()));
      write_numerators(parts, trial);
      Residual E = residual(problem_, evaluate_groups(problem_, trial, false), trial.B);
      if (!(E.cost < result_.E.cost)) continue;
      beta_ = std::move(trial);
      parts_ = std::move(parts);
      result_.E = std::move(E);
      result_.cost.push_back(result_.E.cost);
      ++result_.iterations;
      if (options_.progress) options_.progress(result_.iterations, result_.E.cost);
      levenberg_ = levenberg_ > 1e-9 ? 0.1 * levenberg_ : 0.0;
      return true;
    }
    return false;
  }

  void fill(LowRankResult& out, bool likelihood) {
    const std::vector<BasisGroup> groups = evaluate_groups(problem_, beta_, true);
    const ArrowSystem system(problem_, beta_, groups, FitMethod::gn);
    reduce(system);
    const double per_degree = residual_per_degree(problem_, result_.E, size_);
    const double scale = residual_scale(per_degree, likelihood);
    const Eigen::MatrixXd C = 0.5 * scale * free_inverse(N_, frozen_);
    const Eigen::Index globals = problem_.globals();
    out.covariance.residual_scale = scale;
    out.covariance.globals = C.topLeftCorner(globals, globals);
    out.covariance.response_variance.resize(problem_.channels(), problem_.size());
    const std::vector<DerivativeColumn> columns = derivative_columns(problem_);
    for (const BasisGroup& group : groups) {
      parallel_tasks(static_cast<int>(group.channels.size()), problem_.threads, [&](int r) {
        const Eigen::Index c = group.channels[static_cast<std::size_t>(r)];
        std::vector<Entry> entries;
        channel_entries(c, entries);
        std::vector<Eigen::Index> own;  // parameters of this channel
        for (Eigen::Index p = 0; p < globals; ++p) own.push_back(p);
        for (const Entry& t : entries) own.push_back(t.parameter);
        std::sort(own.begin(), own.end());
        own.erase(std::unique(own.begin(), own.end()), own.end());
        Eigen::MatrixXd re;
        Eigen::MatrixXd im;
        global_columns(problem_, beta_, group, c, columns, re, im);
        const auto n = static_cast<Eigen::Index>(own.size());
        re.conservativeResizeLike(Eigen::MatrixXd::Zero(problem_.size(), n));
        im.conservativeResizeLike(Eigen::MatrixXd::Zero(problem_.size(), n));
        for (const Entry& t : entries) {
          const auto at = std::lower_bound(own.begin(), own.end(), t.parameter) - own.begin();
          re.col(at) += t.value * group.F_re.col(t.function);
          im.col(at) += t.value * group.F_im.col(t.function);
        }
        out.covariance.response_variance.row(c) =
            quadratic(re, im, C(own, own), re, im).transpose();
      });
    }
  }

  const FitProblem& problem_;
  FitParameters& beta_;
  const FitOptions& options_;
  PoleBounds bounds_;
  std::vector<Part> parts_;
  std::vector<int> ranks_;
  Eigen::Index size_ = 0;
  IterationResult result_;
  Eigen::MatrixXd N_;
  Eigen::VectorXd g_;
  std::vector<Eigen::Index> frozen_;
  double levenberg_ = 0.0;
  double gradient_ = 1.0;
};

}  // namespace

LowRankResult iterate_low_rank(const FitProblem& problem, FitParameters& beta,
                               const FitOptions& options, bool likelihood) {
  return LowRankIteration(problem, beta, options).run(likelihood);
}

}  // namespace stageid

#include "estimation/equations/residue_factors.hpp"

#include <cmath>

namespace stageid {
namespace {

int rank_of(const FitProblem& problem, std::size_t i, const Eigen::VectorXd& a,
            const FitOptions& options) {
  const SubmodelShape& shape = problem.shapes[i];
  if (shape.integrators > 0) return options.rigid_body_rank;
  if (shape.order != 2 || !(a[1] > 0.0)) return 0;
  const double omega = 1.0 / std::sqrt(a[1]);
  const Eigen::VectorXd& lines = problem.lines.omega_rad_s;
  if (!(omega > lines.minCoeff() && omega < lines.maxCoeff())) return 0;
  const int own = options.mode_ranks.empty() ? 0 : options.mode_ranks[i];
  return own > 0 ? own : options.residue_rank;
}

}  // namespace

ResidueFactors::ResidueFactors(const FitProblem& problem, const FitParameters& beta,
                               const FitOptions& options)
    : n_outputs_(problem.n_outputs), n_inputs_(problem.n_inputs), globals_(problem.globals()) {
  Eigen::Index function = 0;
  Eigen::Index denominator = 0;
  size_ = globals_;
  for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
    const SubmodelShape& shape = problem.shapes[i];
    ranks_.push_back(rank_of(problem, i, beta.a[i], options));
    parts_.push_back({ResidueForm(shape, ranks_.back(), n_outputs_, n_inputs_), shape.functions(),
                      function, denominator, size_});
    function += shape.functions();
    denominator += shape.order;
    size_ += parts_.back().form.size();
  }
}

void ResidueFactors::project(const FitParameters& beta, const Eigen::MatrixXd& weight) {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = parts_[i];
    part.form.project(beta.a[i], beta.B.middleCols(part.first_function, part.functions),
                      weight.col(part.first_function).reshaped(n_outputs_, n_inputs_));
  }
}

void ResidueFactors::write_numerators(FitParameters& beta) const {
  for (std::size_t i = 0; i < parts_.size(); ++i)
    beta.B.middleCols(parts_[i].first_function, parts_[i].functions) =
        parts_[i].form.numerators(beta.a[i]);
}

void ResidueFactors::step(const Eigen::VectorXd& step) {
  for (Part& part : parts_) part.form.step(step.segment(part.first_parameter, part.form.size()));
}

std::vector<ResidueFactors::Entry> ResidueFactors::channel_entries(const FitParameters& beta,
                                                                   Eigen::Index channel) const {
  std::vector<Entry> out;
  std::vector<ResidueForm::Derivative> own;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    part.form.derivatives(beta.a[i], channel, own);
    for (const auto& [function, parameter, value] : own)
      out.push_back({part.first_function + function,
                     parameter >= 0 ? part.first_parameter + parameter
                                    : part.first_denominator - 1 - parameter,
                     value});
  }
  return out;
}

Eigen::MatrixXd ResidueFactors::reduced_matrix(const FitParameters& beta,
                                               const ArrowSystem& system) const {
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(size_, size_);
  N.topLeftCorner(globals_, globals_) = system.M_globals();
  for (Eigen::Index c = 0; c < n_outputs_ * n_inputs_; ++c) {
    const ArrowSystem::Channel& channel = system.channel(c);
    const std::vector<Entry> entries = channel_entries(beta, c);
    for (const Entry& t : entries) {
      N.col(t.parameter).head(globals_) += t.value * channel.ab.col(t.function);
      N.row(t.parameter).head(globals_) += t.value * channel.ba.row(t.function);
      for (const Entry& o : entries)
        N(t.parameter, o.parameter) += t.value * channel.bb(t.function, o.function) * o.value;
    }
  }
  return N;
}

Eigen::VectorXd ResidueFactors::reduced_gradient(const FitParameters& beta,
                                                 const ArrowSystem& system) const {
  Eigen::VectorXd g = Eigen::VectorXd::Zero(size_);
  g.head(globals_) = system.e_globals();
  for (Eigen::Index c = 0; c < n_outputs_ * n_inputs_; ++c)
    for (const Entry& t : channel_entries(beta, c))
      g[t.parameter] += t.value * system.channel(c).e[t.function];
  return g;
}

}  // namespace stageid

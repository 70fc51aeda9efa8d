#include "estimation/model/submodel_request.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "acquisition/files/counted.hpp"
#include "estimation/model/poles.hpp"

namespace stageid {
namespace {

constexpr double kUsualDamping = 0.01;

std::string fault_of_start(const SubmodelRequest& request) {
  const auto poles = static_cast<std::size_t>(request.pairs() + (request.has_real_pole() ? 1 : 0));
  const auto pairs = static_cast<std::size_t>(request.pairs());
  const std::vector<double>& f = request.frequency_hz;
  const std::vector<double>& zeta = request.damping_ratio;
  if (request.order_by_search && !(f.empty() && zeta.empty()))
    return "n=auto searches the poles; omit frequencies and damping ratios";
  if (!f.empty() && f.size() != poles)
    return fmt::format("n={} needs {}{}; {} given", request.shape.order,
                       counted(poles, "frequency", "frequencies"),
                       request.has_real_pole() && pairs > 0 ? ", the last for the real pole" : "",
                       f.size());
  if (!std::ranges::all_of(f, [](double x) { return std::isfinite(x) && x > 0.0; }))
    return "frequencies must be above 0 Hz";
  if (!zeta.empty() && f.empty())
    return "a damping ratio needs a frequency; give both, or neither to search for them";
  if (zeta.size() > 1 && zeta.size() != pairs)
    return fmt::format("n={} needs one damping ratio or {}; {} given", request.shape.order, pairs,
                       zeta.size());
  if (!zeta.empty() && pairs == 0) return "a real pole has no damping ratio; omit it";
  if (!std::ranges::all_of(zeta, [](double x) { return x > 0.0 && x <= 0.9; }))
    return "damping ratios must be above 0 and at most 0.9";
  for (auto at = f.begin(); at != f.begin() + std::min(pairs, f.size()); ++at)
    if (std::find(f.begin(), at, *at) != at)
      return fmt::format("two poles start at {} Hz, where they are indistinguishable; move one",
                         *at);
  return {};
}

}  // namespace

std::string fault_of(const SubmodelRequest& request) {
  const auto [l, n, m] = request.shape;
  if (request.order_by_search && l > 0) return "n=auto does not support integrators; omit l";
  if (l < 0 || l > 2) return fmt::format("l={} is out of range; give 0, 1 or 2 integrators", l);
  if (n < 0 || n > kLargestOrder)
    return fmt::format("n={} is out of range; give an order from 0 to {}, or several submodels", n,
                       kLargestOrder);
  if (m < 0)
    return fmt::format("m={} is out of range; the degree of the numerator must be 0 or more", m);
  if (!request.order_by_search && m > n + l)
    return fmt::format("m={} is above n + l = {}, so the submodel is improper; give at most {}", m,
                       n + l, n + l);
  return fault_of_start(request);
}

std::string fault_of(const std::vector<SubmodelRequest>& requests, bool rigid_body,
                     bool direct_term) {
  const auto count = [&](auto predicate) { return std::ranges::count_if(requests, predicate); };
  const auto integrating = count([](const SubmodelRequest& r) { return r.shape.integrators > 0; }) +
                           (rigid_body ? 1 : 0);
  if (integrating > 1)
    return fmt::format("{} terms with integrators (l > 0{}) are indistinguishable; keep one",
                       integrating, rigid_body ? ", including the rigid body" : "");
  const auto biproper =
      count([](const SubmodelRequest& r) { return r.biproper(); }) + (direct_term ? 1 : 0);
  if (biproper > 1)
    return fmt::format("{} biproper terms (m = n + l{}) are indistinguishable; keep one", biproper,
                       direct_term ? ", including the direct term" : "");
  if (requests.size() > 1 && count([](const SubmodelRequest& r) { return r.order_by_search; }) > 0)
    return "n=auto puts all modes into one denominator, so it must be the only submodel";
  return {};
}

Submodel start_submodel(const FrfEstimate& frf, const SubmodelRequest& request) {
  std::vector<std::complex<double>> poles;
  for (int i = 0; i < request.pairs(); ++i) {
    const std::vector<double>& zeta = request.damping_ratio;
    const double damping =
        zeta.empty() ? kUsualDamping : zeta[std::min<std::size_t>(i, zeta.size() - 1)];
    for (const std::complex<double> pole : mode_poles(request.frequency_hz[i], damping))
      poles.push_back(pole);
  }
  if (request.has_real_pole())
    poles.emplace_back(-2.0 * std::numbers::pi * request.frequency_hz.back());
  Submodel s;
  s.integrators = request.shape.integrators;
  const Eigen::VectorXd a = denominator_of(poles);
  s.denominator.insert(s.denominator.end(), a.begin(), a.end());
  s.numerator.assign(request.shape.functions(),
                     Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs()));
  s.role = SubmodelRole::given;
  return s;
}

}  // namespace stageid

#include "tools/control/stage_loop.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "acquisition/files/fail.hpp"
#include "hal/simulator/rigid_body.hpp"

namespace stageid {
namespace {

constexpr double kSameRate = 1e-9;
/// Entries of a decoupling matrix below this, relative to the largest, are rounding errors of a pseudoinverse.
constexpr double kRounding = 1e-9;

/// The place of every channel of the stage in the model; none: not in the model.
std::vector<std::optional<Eigen::Index>> places_of(const std::vector<Channel>& channels,
                                                   const ChannelList& list) {
  std::vector<std::optional<Eigen::Index>> out;
  for (const Channel& channel : channels) {
    const auto found = std::ranges::find(list.names, channel.name);
    out.push_back(found == list.names.end() ? std::nullopt
                                            : std::optional(found - list.names.begin()));
  }
  return out;
}

/// One loop of the stage: its entries of the decoupling matrices.
struct Usage {
  std::string name;
  Eigen::VectorXd sensors;
  Eigen::VectorXd actuators;
};

class LoopBuilder {
 public:
  LoopBuilder(const StageSpec& stage, const AdditiveModel& model)
      : stage_(stage),
        model_(model),
        sensors_(places_of(stage.info.sensors, model.outputs)),
        actuators_(places_of(stage.info.actuators, model.inputs)) {}

  LoopController build() {
    MotionControllerSpec spec = stage_.controller;
    spec.feed_forward_n.resize(0);
    const bool by_axes = spec.transfer.empty() && spec.state_space.empty();
    return by_axes ? of_axes(std::move(spec)) : of_actuators(spec);
  }

 private:
  static bool used(const Eigen::VectorXd& entries, Eigen::Index i) {
    return std::abs(entries[i]) > kRounding * entries.cwiseAbs().maxCoeff();
  }

  /// Whether any of the channels that a loop uses is in the model.
  static bool any_in_model(const std::vector<std::optional<Eigen::Index>>& places,
                           const Eigen::VectorXd& entries) {
    for (std::size_t i = 0; i < places.size(); ++i)
      if (places[i] && used(entries, static_cast<Eigen::Index>(i))) return true;
    return false;
  }

  /// The entries for the channels of the model.
  static Eigen::MatrixXd columns_for(const Eigen::MatrixXd& by_stage,
                                     const std::vector<std::optional<Eigen::Index>>& places,
                                     Eigen::Index count) {
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(by_stage.rows(), count);
    for (std::size_t i = 0; i < places.size(); ++i)
      if (places[i]) out.col(*places[i]) = by_stage.col(i);
    return out;
  }

  void require_channels(const Usage& loop) const {
    const auto check = [&](const auto& places, const auto& channels, const auto& entries,
                           const char* kind, const char* in) {
      for (std::size_t i = 0; i < places.size(); ++i)
        if (!places[i] && used(entries, static_cast<Eigen::Index>(i)))
          fail_request(
              "the loop of {} uses {} '{}', which is not an {} of the model; identify all channels "
              "of the controller",
              loop.name, kind, channels[i].name, in);
    };
    check(sensors_, stage_.info.sensors, loop.sensors, "sensor", "output");
    check(actuators_, stage_.info.actuators, loop.actuators, "actuator", "input");
  }

  LoopController of_axes(MotionControllerSpec spec) const {
    std::vector<Eigen::Index> kept;
    std::vector<std::string> names;
    std::vector<AxisController> axes;
    for (std::size_t a = 0; a < spec.axes.size(); ++a) {
      const Usage loop{kRigidAxisNames.at(a), spec.sensor_decoupling.row(a).transpose(),
                       spec.actuator_decoupling.col(a)};
      if (spec.axes[a].crossover_hz == 0.0 || !any_in_model(sensors_, loop.sensors) ||
          !any_in_model(actuators_, loop.actuators))
        continue;
      require_channels(loop);
      kept.push_back(a);
      names.push_back(loop.name);
      axes.push_back(spec.axes[a]);
    }
    const Eigen::MatrixXd T = columns_for(spec.actuator_decoupling(Eigen::all, kept).transpose(),
                                          actuators_, model_.n_inputs())
                                  .transpose();
    spec.axes = axes;
    spec.sensor_decoupling = spec.sensor_decoupling(kept, Eigen::all).eval();
    const auto n = std::ssize(kept);
    spec.actuator_decoupling = Eigen::MatrixXd::Identity(n, n);
    return finish(names, T, n == 0 ? ControllerStateSpace{} : MotionController(spec).realization());
  }

  LoopController of_actuators(const MotionControllerSpec& spec) const {
    ControllerStateSpace k = MotionController(spec).realization();
    Eigen::MatrixXd from(k.a.rows() + k.d.rows(), k.d.cols());
    from << k.b, k.d;
    Eigen::MatrixXd to(k.d.rows(), k.a.cols() + k.d.cols());
    to << k.c, k.d;
    const Usage all{"the controller", from.cwiseAbs().colwise().maxCoeff().transpose(),
                    to.cwiseAbs().rowwise().maxCoeff()};
    require_channels(all);
    std::vector<Eigen::Index> kept;
    std::vector<std::string> names;
    for (Eigen::Index i = 0; i < all.actuators.size(); ++i) {
      if (!used(all.actuators, i)) continue;
      kept.push_back(i);
      names.push_back(stage_.info.actuators[i].name);
    }
    const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(k.d.rows(), k.d.rows());
    const Eigen::MatrixXd T =
        columns_for(identity(kept, Eigen::all), actuators_, model_.n_inputs()).transpose();
    k.c = k.c(kept, Eigen::all).eval();
    k.d = k.d(kept, Eigen::all).eval();
    return finish(names, T, k);
  }

  LoopController finish(std::vector<std::string> names, Eigen::MatrixXd T,
                        const ControllerStateSpace& k) const {
    if (names.empty())
      fail_request(
          "its controller closes no loop between channels of the model; use the stage file of the "
          "measurement");
    LoopController out{std::move(names), std::move(T), {}};
    out.system.A = k.a;
    out.system.B = columns_for(k.b, sensors_, model_.n_outputs());
    out.system.C = k.c;
    out.system.D = columns_for(k.d, sensors_, model_.n_outputs());
    return out;
  }

  const StageSpec& stage_;
  const AdditiveModel& model_;
  std::vector<std::optional<Eigen::Index>> sensors_;
  std::vector<std::optional<Eigen::Index>> actuators_;
};

}  // namespace

LoopController stage_loop(const StageSpec& stage, const AdditiveModel& model) {
  if (stage.controller.by_peer)
    fail_request(
        "the stage closes its loop by a controller of its own ('controller: peer'); write its "
        "matrices or transfer functions into a copy of the stage file");
  const double rate_hz = stage.info.sample_rate_hz;
  if (std::abs(rate_hz - model.sample_rate_hz) > kSameRate * rate_hz)
    fail_request(
        "its sample rate is {} Hz, that of the model {} Hz; use the stage file of the "
        "measurement",
        rate_hz, model.sample_rate_hz);
  return LoopBuilder(stage, model).build();
}

}  // namespace stageid

// One cycle of the wafer stage on one core: the cost of hal per sample of the measurement loop.
#include <benchmark/benchmark.h>

#include <vector>

#include "hal/simulator/modal_plant.hpp"
#include "hal/simulator/noise.hpp"
#include "hal/stage/limited_stage.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace {

using namespace stageid;

void plant_step(benchmark::State& state) {
  const test::SimulatedSpec spec = test::wafer_stage_spec();
  ModalPlant plant(plant_modes(spec.info, spec.plant), spec.info.delay_s, spec.info.sample_rate_hz);
  std::vector<double> u(17, 0.1);
  std::vector<double> y(7);
  for (auto _ : state) {
    plant.step(u.data());
    plant.output(y.data());
    benchmark::DoNotOptimize(y.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(plant_step);

void controller_update(benchmark::State& state) {
  MotionController controller(test::wafer_stage_spec().controller);
  std::vector<double> u(17);
  std::vector<double> y(7, 1e-9);
  for (auto _ : state) {
    controller.update(y.data(), u.data());
    benchmark::DoNotOptimize(u.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(controller_update);

void noise_sample(benchmark::State& state) {
  StageNoise noise({17, 7, 1e4, 1e-3, 1e-10, 1e-10, 20.0});
  noise.restart(1, 1);
  for (auto _ : state) {
    noise.next();
    benchmark::DoNotOptimize(noise.sensor_m());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(noise_sample);

void closed_loop_cycle(benchmark::State& state, const test::SimulatedSpec& spec) {
  LimitedStage stage(test::simulated(spec), spec.limits);
  MotionController controller(spec.controller);
  std::vector<double> y(7);
  std::vector<double> u(17);
  Inputs inputs;
  inputs.y = y;
  stage.start(1, inputs);
  Outputs outputs;
  outputs.u = u;
  for (auto _ : state) {
    controller.update(y.data(), u.data());
    outputs.cycle = inputs.cycle;
    if (stage.exchange(outputs, inputs, {}) != Outcome::ok) state.SkipWithError("not ok");
  }
  state.counters["times_real_time"] =
      benchmark::Counter(static_cast<double>(state.iterations()) / spec.info.sample_rate_hz,
                         benchmark::Counter::kIsRate);
}

void limited_closed_loop_cycle(benchmark::State& state) {
  closed_loop_cycle(state, test::wafer_stage_spec());
}
BENCHMARK(limited_closed_loop_cycle);

void cycle_in_a_ramp_of_all_modes(benchmark::State& state) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  spec.simulation.faults = {{SimulationSpec::Fault::Kind::mode_frequency, -1, 0, 1, -1, 1e-3, 1e6}};
  closed_loop_cycle(state, spec);
}
BENCHMARK(cycle_in_a_ramp_of_all_modes);

}  // namespace

BENCHMARK_MAIN();

// A back end in C that passes everything on to a CyclicStage of the same process, whose address is the key `stage`.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "hal/plugin/stageid_backend.h"
#include "hal/stage/stage.hpp"

namespace {

using namespace stageid;

struct Wrapped {
  CyclicStage* stage = nullptr;
  std::size_t actuators = 0;
  std::size_t sensors = 0;
};

Wrapped& of(void* stage) { return *static_cast<Wrapped*>(stage); }

void give(const Inputs& inputs, stageid_sample& sample) {
  sample.valid = inputs.valid;
  sample.t_sample_ns = inputs.t_sample_ns;
  sample.t_receive_ns = inputs.t_rx_ns;
}

int code_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::ok:
    case Outcome::late:
    case Outcome::incomplete:
    case Outcome::stale:
    case Outcome::corrupt:
      return static_cast<int>(outcome);
    case Outcome::link_down:
      return STAGEID_LINK_DOWN;
    default:
      return STAGEID_FAULT;
  }
}

void* open_stage(const stageid_request* request, char* error, std::size_t size) {
  if (request->n_keys == 1 && std::strcmp(request->keys[0].name, "stage") == 0)
    return new Wrapped{
        reinterpret_cast<CyclicStage*>(std::strtoull(request->keys[0].value, nullptr, 10)),
        request->n_actuators, request->n_sensors};
  std::snprintf(error, size, "no key 'stage'");
  return nullptr;
}

void describe(void*, stageid_description* description) { description->virtual_time = 1; }

int start(void* stage, uint64_t seed, stageid_sample* first, char*, std::size_t) {
  Inputs inputs;
  inputs.y = {first->y, of(stage).sensors};
  of(stage).stage->start(seed, inputs);
  give(inputs, *first);
  return 0;
}

int exchange(void* stage, uint64_t cycle, const double* u, int64_t deadline_ns,
             stageid_sample* next) {
  Inputs inputs;
  inputs.y = {next->y, of(stage).sensors};
  const int code =
      code_of(of(stage).stage->exchange({cycle, {u, of(stage).actuators}}, inputs, {deadline_ns}));
  give(inputs, *next);
  return code;
}

void stop(void* stage) { of(stage).stage->stop(); }
void trouble(void*, char* text, std::size_t) { text[0] = '\0'; }
void close_stage(void* stage) { delete &of(stage); }

const stageid_backend kBackend = {STAGEID_BACKEND_VERSION,
                                  sizeof(stageid_backend),
                                  open_stage,
                                  describe,
                                  start,
                                  exchange,
                                  stop,
                                  trouble,
                                  close_stage};

}  // namespace

extern "C" const stageid_backend* stageid_get_backend(void) { return &kBackend; }

#include <string.h>

#include "can_node.h"

#ifndef SAMPLES_PER_TICK /* of the simulated stage; 1 with converters */
#define SAMPLES_PER_TICK 256
#endif
enum { ROW_BYTES = 4 * (STAGE_ACTUATORS + STAGE_SENSORS + 1) };

const char* can_upload(struct can_node* node, const struct can_command* command) {
  uint64_t bytes = 4 * (uint64_t)command->c;
  int i, channels = 0;
  if (node->resident == PLAYING) return "a resident experiment is running; stop it first";
  node->token = (uint8_t)command->host;
  if (command->a == node->mask && command->b == node->digest && command->c == node->period) return NULL;
  for (i = 0; i < STAGE_ACTUATORS; ++i) channels += (int)(command->a >> i & 1);
  bytes *= (uint64_t)channels;
  if (bytes == 0 || command->a >> STAGE_ACTUATORS != 0) return "the mask or the number of samples is wrong";
  if (bytes > CAN_WAVEFORM_BYTES) return "the waveform exceeds the memory";
  if (node->resident == ARMED) node->state = SWITCH_ON_DISABLED;
  node->resident = IDLE;
  node->mask = command->a;
  node->digest = command->b;
  node->period = command->c;
  node->waveform_bytes = (uint32_t)bytes;
  node->chunks = (node->waveform_bytes + CAN_CHUNK - 1) / CAN_CHUNK;
  node->missing = 0;
  memset(node->received, 0, sizeof node->received);
  return NULL;
}

static int has(const struct can_node* node, uint32_t chunk) { return node->received[chunk / 8] >> chunk % 8 & 1; }

void can_take_chunk(struct can_node* node, const struct can_message* message) {
  const uint32_t chunk = (uint32_t)can_take(message->data, 3), at = chunk * CAN_CHUNK;
  const uint32_t used = (uint32_t)can_take(message->data + 4, 2);
  if (!can_intact(message, CAN_CHUNK) || message->data[3] != node->token || chunk >= node->chunks ||
      node->resident == ARMED || node->resident == PLAYING ||
      used != (chunk + 1 < node->chunks ? CAN_CHUNK : node->waveform_bytes - at)) {
    ++node->rejected;
    return;
  }
  memcpy(node->waveform + at, message->data + CAN_HEADER, used);
  node->received[chunk / 8] |= (uint8_t)(1 << chunk % 8);
  while (node->missing < node->chunks && has(node, node->missing)) ++node->missing;
}

void can_send_missing(const struct can_node* node) {
  struct can_message message;
  uint32_t i;
  memset(&message, 0, sizeof message);
  for (i = 0; i < 384 && node->missing + i < node->chunks; ++i)
    if (has(node, node->missing + i)) message.data[CAN_HEADER + i / 8] |= (uint8_t)(1 << i % 8);
  can_seal(&message, MISSING_CHUNKS, 48, (uint16_t)node->missing, (uint8_t)(node->missing >> 16), node->token, 0);
  can_send(&message);
}

const char* can_arm(struct can_node* node, const struct can_command* command) {
  const char* refusal;
  if (node->state == MEASURING) return "a run is in progress; stop it first";
  if (node->chunks == 0 || node->missing < node->chunks) return "the waveform is incomplete; upload it first";
  if (can_hash64(node->waveform, node->waveform_bytes) != node->digest || (uint32_t)node->digest != command->d)
    return "the memory contains a different waveform; upload it";
  if (command->b == 0 || command->b > CAN_TRACE_BYTES / ROW_BYTES) return "the run exceeds the trace memory";
  if ((refusal = can_enable(node)) != NULL) return refusal;
  if (!node->reserved) can_draw_key(node);
  node->trace_session = node->session;
  node->resident = ARMED;
  node->reserved = 1;
  node->seed_high = (uint32_t)(command->a >> 32);
  node->seed_low = (uint32_t)command->a;
  node->samples = command->b;
  node->ramp = command->c;
  node->trace_bytes = 0;
  return NULL;
}

const char* can_trigger(struct can_node* node, const struct can_command* command) {
  if (node->resident > ARMED && command->sequence == node->trigger_sequence) return NULL;
  if (node->resident != ARMED) return "not armed; arm it first";
  node->trigger_sequence = command->sequence;
  can_begin(node, (uint64_t)node->seed_high << 32 | node->seed_low);
  node->resident = PLAYING;
  return NULL;
}

const char* can_download(struct can_node* node, const struct can_command* command) {
  const uint32_t bytes = command->b == 1 ? node->trace_bytes : node->waveform_bytes;
  const uint32_t chunks = (bytes + CAN_CHUNK - 1) / CAN_CHUNK;
  if (command->b > 1 || command->a >= chunks) return "the memory has no such chunk";
  if (command->b == 1 && node->resident == PLAYING) return "the trace is still being recorded";
  node->token = (uint8_t)command->host;
  node->downloads_trace = (uint8_t)command->b;
  node->next_chunk = (uint32_t)command->a;
  node->end_chunk = node->next_chunk + (command->c < 256 ? command->c : 256);
  if (node->end_chunk > chunks) node->end_chunk = chunks;
  return NULL;
}

static void put_float(uint8_t* bytes, float value) {
  uint32_t bits; /* IEEE 754 */
  memcpy(&bits, &value, sizeof bits);
  can_put(bytes, bits, 4);
}

/* The controller of the stage, u = C(y) + r. This stage needs none: C = 0. */
static void control(const double y_m[STAGE_SENSORS], double u_n[STAGE_ACTUATORS]) {
  (void)y_m;
  memset(u_n, 0, STAGE_ACTUATORS * sizeof *u_n);
}

static void play_sample(struct can_node* node) {
  const uint64_t past = node->sample < node->samples ? 0 : node->sample - node->samples + 1;
  const double gain = (double)(node->ramp + 1 - past) / (double)(node->ramp + 1);
  const uint8_t* value;
  double u_n[STAGE_ACTUATORS];
  int i, channels = 0;
  for (i = 0; i < STAGE_ACTUATORS; ++i) channels += (int)(node->mask >> i & 1);
  value = node->waveform + 4 * (uint32_t)(node->sample % node->period) * (uint32_t)channels;
  control(node->y_m, u_n);
  for (i = 0; i < STAGE_ACTUATORS; ++i)
    if (node->mask >> i & 1) {
      const uint32_t bits = (uint32_t)can_take(value, 4);
      float r;
      memcpy(&r, &bits, sizeof r);
      u_n[i] += gain * (double)r;
      value += 4;
    }
  if (node->sample < node->samples) {
    uint8_t* row = node->trace + node->trace_bytes;
    for (i = 0; i < STAGE_ACTUATORS; ++i, row += 4) put_float(row, (float)u_n[i]);
    for (i = 0; i < STAGE_SENSORS; ++i, row += 4) put_float(row, (float)node->y_m[i]);
    can_put(row, 0, 4); /* outcome of y[n]: a bad one ends the run before its row */
    node->trace_bytes += ROW_BYTES;
  }
  if (!can_move(node, u_n)) return;
  if (node->sample < node->samples + node->ramp) return;
  stage_hardware_stop();
  node->state = OPERATION_ENABLED;
  node->resident = DONE;
}

/* As many chunks as the queue of the bus takes; the rest with the next tick. */
void can_send_chunks(struct can_node* node) {
  const uint8_t* memory = node->downloads_trace ? node->trace : node->waveform;
  const uint32_t bytes = node->downloads_trace ? node->trace_bytes : node->waveform_bytes;
  for (; node->next_chunk < node->end_chunk; ++node->next_chunk) {
    const uint32_t at = node->next_chunk * CAN_CHUNK, used = bytes - at < CAN_CHUNK ? bytes - at : CAN_CHUNK;
    struct can_message message;
    memset(&message, 0, sizeof message);
    memcpy(message.data + CAN_HEADER, memory + at, used);
    can_seal(&message, DOWNLOAD_CHUNK, CAN_CHUNK, (uint16_t)node->next_chunk, (uint8_t)(node->next_chunk >> 16),
         node->token, (uint16_t)used);
    if (!can_send(&message)) return;
  }
}

void can_play(struct can_node* node) {
  int i;
  for (i = 0; i < SAMPLES_PER_TICK && node->resident == PLAYING; ++i) play_sample(node); /* one per tick of a clock */
}

#include "can_frame.h"

void can_put(uint8_t* bytes, uint64_t value, int count) {
  for (; count > 0; --count, value >>= 8) *bytes++ = (uint8_t)value;
}

uint64_t can_take(const uint8_t* bytes, int count) {
  uint64_t value = 0;
  while (count > 0) value = value << 8 | bytes[--count];
  return value;
}

static uint16_t crc_byte(uint16_t crc, uint8_t byte) { /* CRC-16/CCITT-FALSE: 0x1021, from 0xFFFF */
  int bit;
  crc ^= (uint16_t)(byte << 8);
  for (bit = 0; bit < 8; ++bit) crc = (uint16_t)((crc & 0x8000) != 0 ? crc << 1 ^ 0x1021 : crc << 1);
  return crc;
}

static uint16_t crc_of(const struct can_message* message) { /* without the CRC itself, bytes 6 and 7 */
  uint16_t crc = crc_byte(crc_byte(0xFFFF, (uint8_t)message->id), (uint8_t)(message->id >> 8));
  int i;
  for (i = 0; i < message->length; ++i)
    if (i != 6 && i != 7) crc = crc_byte(crc, message->data[i]);
  return crc;
}

static uint8_t can_length(int bytes) {
  static const uint8_t lengths[] = {8, 12, 16, 20, 24, 32, 48};
  int i;
  for (i = 0; i < 7; ++i)
    if (bytes <= lengths[i]) return lengths[i];
  return 64;
}

/* The payload is in place; the rest of data is 0. */
void can_seal(struct can_message* message, uint16_t id, int payload, uint16_t sequence, uint8_t kind, uint8_t run,
                 uint16_t detail) {
  message->id = id;
  message->length = can_length(CAN_HEADER + payload);
  can_put(message->data, sequence, 2);
  message->data[2] = kind;
  message->data[3] = run;
  can_put(message->data + 4, detail, 2);
  can_put(message->data + 6, crc_of(message), 2);
}

int can_intact(const struct can_message* message, int payload) {
  return message->length == can_length(CAN_HEADER + payload) && can_take(message->data + 6, 2) == crc_of(message);
}

uint32_t can_hash32(const char* text) { /* FNV-1a */
  uint32_t value = 2166136261u;
  for (; *text != '\0'; ++text) value = (value ^ (uint8_t)*text) * 16777619u;
  return value;
}

uint64_t can_hash64(const uint8_t* bytes, uint32_t count) { /* FNV-1a */
  uint64_t value = 14695981039346656037u;
  while (count-- > 0) value = (value ^ *bytes++) * 1099511628211u;
  return value;
}

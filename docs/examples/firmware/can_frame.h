/* Frames of the CAN FD protocol: little-endian numbers, header, CRC, hashes. */
#ifndef CAN_FRAME_H
#define CAN_FRAME_H

#include <stdint.h>

enum { COMMAND = 0x080, SETPOINT = 0x100, MEASUREMENT = 0x180, STATE = 0x200, TEXT = 0x201, UPLOAD_CHUNK = 0x300,
       DOWNLOAD_CHUNK = 0x380, MISSING_CHUNKS = 0x381 };
enum { HELLO = 1, START = 2, STOP = 3, QUICK_STOP = 4, RESET_FAULT = 5, UPLOAD = 16, MISSING = 17, ARM = 18,
       TRIGGER = 19, DOWNLOAD = 20 };
enum { CAN_HEADER = 8, CAN_CHUNK = 56 };

struct can_message {
  uint16_t id;
  uint8_t length; /* one of the lengths of CAN FD */
  uint8_t data[64];
};

void can_put(uint8_t* bytes, uint64_t value, int count);
uint64_t can_take(const uint8_t* bytes, int count);

/* Completes a frame whose payload is in place; the rest of its data is 0. */
void can_seal(struct can_message* message, uint16_t id, int payload, uint16_t sequence, uint8_t kind, uint8_t run,
              uint16_t detail);
/* Whether length and CRC are correct. */
int can_intact(const struct can_message* message, int payload);

uint32_t can_hash32(const char* text); /* FNV-1a */
uint64_t can_hash64(const uint8_t* bytes, uint32_t count);

#endif

/* What the files of the example share. C99 and POSIX. */
#ifndef FIRMWARE_H
#define FIRMWARE_H
#include <stddef.h>
#include <stdint.h>

enum { HEARTBEAT = 0x010, COMMAND, PARAM_SET, PARAM_GET, CLAIM, COMMAND_REPLY = 0x021, PARAM_REPLY, IDENTITY, OWNER, TELEMETRY = 0x100 };
enum { OFF, READY, LIFTING, LEVITATED, SPINNING, LANDING, COASTING, FAULT };
enum { DISABLE, ENABLE, LEVITATE, LAND, SPIN, STOP, CLEAR_FAULT, MAKE_SAFE, IDENTIFY, RELEASE };
enum { OK, UNKNOWN, OUT_OF_RANGE, WRONG_STATE, WRONG_SESSION };
enum { NO_FAULT = 0, HEARTBEAT_LOST = 4, PROTOCOL = 1, MAP_VERSION = 2, SERIAL = 4660, LIFT_MS = 20 };

/* numbers, little endian */
void put(uint8_t *at, uint32_t value, int bytes);
uint32_t get(const uint8_t *at, int bytes);
void put_float(uint8_t *at, float value);
float get_float(const uint8_t *at);
void put_scaled(uint8_t *at, double value, double scale, double low, double high);

/* controller.c: states, parameters, messages, plant */
extern int64_t now;                /* ticks of 100 us */
extern int state, fault;
extern double speed, angle;
float *parameter(int index);
void take_message(int identifier, const uint8_t *m, int length);
void millisecond(int64_t tick);
void telemetry(uint32_t tick);

/* wire.c: packets and SLCAN, both ways */
extern int packets;                /* rather than SLCAN */
void send_message(int identifier, const uint8_t *payload, int length);
void close_packet(void);
void take_bytes(const uint8_t *in, size_t n);
uint32_t crc16(const uint8_t *in, size_t n);
uint32_t crc32(const uint8_t *in, size_t n);
size_t cobs_encode(const uint8_t *in, size_t n, uint8_t *out);
size_t cobs_decode(const uint8_t *in, size_t n, uint8_t *out);

/* firmware.c: the port */
void enqueue(const uint8_t *bytes, size_t n);
#endif

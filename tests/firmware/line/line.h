/* A controller with the command line of docs/reference/line-protocol.md, written from that page alone. */
#ifndef LINE_H
#define LINE_H
#include <stddef.h>
#include <stdint.h>

#define TICKS 280000u /* in a second */
#define CURRENTS 10
#define CHANNELS 64 /* as many as a mask has bits */
#define MEMORY (32u * 1024 * 1024)
#define COUNT(array) ((int)(sizeof(array) / sizeof((array)[0])))

enum state { OFF, IDLE, CURRENT, LIFT, LEVITATED, LANDING, FAULT };
enum { UNKNOWN_VERB = 1, ARGUMENTS, RANGE, STATE, BUSY, CHECKSUM, TOO_LONG, NOT_OWNER, HARDWARE, NO_CAPTURE };

/* plant.c: currents, positions, states, all by ticks */
struct move { double now, goal, rate; };
extern uint64_t tick, watchdog; /* ticks; the second: without a heartbeat */
extern enum state state;
extern int fault; /* as telemetry has it: 0 none, 4 HEARTBEAT_LOST */
extern double step_of[CURRENTS];  /* A, added to each current's reference */
extern uint64_t step_ends[CURRENTS]; /* tick from which on it is 0 again */
extern struct move moves[6];      /* x1 x2 y1 y2 z gamma: m, rad */
extern const char *const state_names[7], *const axis_names[6], *const fault_names[5];
void plant_start(void);
void plant_to(uint64_t target);
double channel_value(int channel); /* SI, with noise */
double speed(void);                /* rad/s */
void go(enum state next);
void land(enum state then);
void halt(void);
void inject(int axis, int sensor, double amplitude, double hz); /* axis -1: none */
void heard_heartbeat(unsigned counter);
uint64_t heartbeat_age(void); /* ticks */

/* table.c: parameters and channels */
struct parameter { const char *name, *unit; double low, high, delivered; float value, saved; };
struct channel { char name[8]; const char *unit; double scale; };
extern struct parameter parameters[];
extern const int parameter_count;
extern struct channel channels[CHANNELS];
void table_start(void);
struct parameter *parameter_named(const char *name);
int channel_named(const char *name); /* by name or index; -1: none */

/* capture.c */
void capture_tick(void);
void capture_step(void);   /* a step has been made at this tick */
void capture_send(void);   /* blocks, as there is room */
void verb_cap(int words, char **word);
void stream_set(unsigned hz);
void send_block(unsigned number, uint32_t offset, const uint8_t *data, unsigned length);

/* shell.c: lines */
extern int dialect;
void shell_start(void);
void shell_byte(uint8_t byte);
void shell_lost(void); /* the host has gone */
void ok(const char *format, ...);
void more(const char *format, ...);
void fail(int code, const char *format, ...);
void event(const char *format, ...);
int current_tag(void);
void answer_later(int tag, int summed, const char *text); /* the ok of a request that took its time */
int current_summed(void);
const char *word_of(const char *word); /* in the dialect that is spoken */
struct mode { int echo, prompt, checksum, event; };
extern struct mode mode;

/* verbs.c */
void perform(int words, char **word);
void wrong_state(void);
int number_of(const char *text, double *value);

/* main.c: the wire */
void out(const void *bytes, size_t length);
size_t out_room(void);
void tell(const char *format, ...); /* whoever started the program */
#endif

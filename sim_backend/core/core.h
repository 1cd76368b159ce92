/* What all machines of the core share: noise, the modes of a law, time. Units are SI.
 * Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef CORE_H
#define CORE_H
#include <stdint.h>

/* declarations begin */
typedef struct {
    uint64_t key, counter;
} core_noise;

/* tones that are injected: their phasors, how far each turns in a tick, what they are made of */
typedef struct {
    double turn_c[128], turn_s[128], c[128], s[128], made[4];
    int64_t ticks;
    int32_t lines;
} core_tones;

/* what a controller knows of a once-per-turn mark: times of the last three pulses, where each mark fired; of the last reading
 * angle, speed and age */
typedef struct {
    double last, before, earlier, fired[2], angle, speed, age;
    int64_t pulses, counted;
    int32_t known;
} core_tacho;

void core_normals(uint64_t seed, uint64_t stream, double *out, int64_t count);
/* declarations end */

enum { OFF, READY, LIFT, LEVITATE, LAND };
enum { SATURATED = 1, CONTACT_I = 4, CONTACT_O = 8 };
enum { TRIP_LOST = 1, TRIP_CURRENT = 2, TRIP_SPEED = 4 };
#define TICK 1e-4
#define PERIOD 10

/* cosines and sines of n angle, n = 1..4 */
void tsbs_turn(double angle, double *c, double *s);
void core_noise_seed(core_noise *, uint64_t seed, uint64_t stream);
double core_normal(core_noise *);
void core_draws(core_noise *, double *out, int count);
#endif

/* What all machines of the core share: noise, the modes of a law, time. Units are SI.
 * Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef CORE_H
#define CORE_H
#include <stdint.h>

/* declarations begin */
typedef struct {
    uint64_t key, counter;
} core_noise;

void core_normals(uint64_t seed, uint64_t stream, double *out, int64_t count);
/* declarations end */

enum { OFF, READY, LIFT, LEVITATE, LAND };
enum { SATURATED = 1, CONTACT_I = 4, CONTACT_O = 8 };
enum { TRIP_LOST = 1, TRIP_CURRENT = 2, TRIP_SPEED = 4 };
#define TICK 1e-4
#define PERIOD 10

void core_noise_seed(core_noise *, uint64_t seed, uint64_t stream);
double core_normal(core_noise *);
void core_draws(core_noise *, double *out, int count);
#endif

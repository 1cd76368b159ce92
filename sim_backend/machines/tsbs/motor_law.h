/* What the two halves of the law share: law.c holds the AMBs, motor_law.c turns and carries by the motor. */
#ifndef MOTOR_LAW_H
#define MOTOR_LAW_H
#include <math.h>
#include "numbers.h"
#include "tsbs.h"

/* balance: 1 is sound; more are planted defects (docs/reference/load-balancing.md): the load's line wrapped into two quadrants, phi
 * with the wrong sign, an observer that takes what was asked for the currents that there are */
enum { BALANCED = 1, WRAPPED = 2, OTHER_SIGN = 3, UNLIMITED = 4 };

/* share of a first-order filter's memory that survives a tick (backward Euler) */
#define KEEP(hz) (1 / (1 + TWO_PI * (hz) * TICK))

static inline double toward(double from, double to, double step) { return from + clip(to - from, -step, step); }

/* a set angle is meant within a turn: after spinning, the nearest such angle is the target, not the way back */
static inline double whole_turns(double angle) { return TWO_PI * floor(angle / TWO_PI + 0.5); }

void tsbs_rotate(const tsbs_control *, const tsbs_gains *, tsbs_law_state *, const tsbs_reading *, tsbs_reference *);
void tsbs_carry(const tsbs_control *, double keep, tsbs_law_state *, const double *y, double *current);
void tsbs_lie(tsbs_law_state *, const double *y);
void tsbs_observe(const tsbs_control *, tsbs_law_state *, const double *y);
void tsbs_balance(const tsbs_control *, tsbs_law_state *);
void tsbs_allocate(const tsbs_control *, tsbs_law_state *, double ix, double iy, double turn, tsbs_reference *);
#endif

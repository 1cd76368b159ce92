/* Control law: a pure function of the reading, its own state and its parameters, called every 100 us. PID on the height,
 * constant current sum. */
#include <math.h>
#include "oneaxis.h"

double oneaxis_clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

/* share of the way that the reference has gone from where the body lay to the set point */
static double lifted(const oneaxis_control *c, oneaxis_law_state *l) {
    if (l->mode == LEVITATE) return 1;
    l->lift_clock = fmin(l->lift_clock + TICK, c->lift_time_s);
    double t = l->lift_clock / c->lift_time_s, smooth = t * t * (3 - 2 * t);
    return l->mode == LIFT ? smooth : 1 - smooth;
}

void oneaxis_law(const oneaxis_control *c, oneaxis_law_state *l, double y, double *coil) {
    if (l->fresh) { /* after a change from rest: no derivative kick, the reference starts where the body lies */
        l->previous = y;
        if (l->mode == LIFT) {
            l->rest = y;
            l->integral = l->filtered = 0;
        }
        l->fresh = 0;
    }
    double keep = 1 / (1 + 6.283185307179586 * c->derivative_hz * TICK);
    l->filtered = keep * l->filtered + (1 - keep) * (y - l->previous) / TICK;
    l->previous = y;
    coil[0] = coil[1] = 0;
    if (l->mode < LIFT || (l->mode == LAND && l->lift_clock >= c->lift_time_s)) return;
    double error = l->rest + lifted(c, l) * (c->ref - l->rest) - y;
    double control = c->kp * error + l->integral - c->kd * l->filtered;
    if (fabs(control) < c->bias || control * error < 0) l->integral += c->ki * error * TICK;
    control = oneaxis_clip(control, -c->bias, c->bias);
    coil[0] = fmin(c->bias + control, c->current_limit);
    coil[1] = fmin(c->bias - control, c->current_limit);
}

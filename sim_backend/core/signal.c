/* Injected tones. */
#include <math.h>
#include <string.h>
#include "signal.h"

/* Sine, or lines at hz + k step with Schroeder's phases - pi k (k + 1)/n, amplitude A each: phasors that are turned
 * from tick to tick and set right every thousand ticks. */
double core_injected(const core_injection *c, core_tones *t, double tick) {
    const double made[4] = {c->hz, c->lines, c->step, c->axis};
    int lines = c->lines > 128 ? 128 : c->lines > 1 ? (int)c->lines : 1;
    if (c->axis < 0 || c->amplitude == 0) {
        t->lines = 0;
        return 0;
    }
    if (t->lines != lines || memcmp(made, t->made, sizeof made) != 0) {
        t->lines = lines;
        t->ticks = 0;
        memcpy(t->made, made, sizeof made);
    }
    double sum = 0;
    for (int k = 0; k < lines; k++) {
        if (t->ticks % 1000 == 0) {
            double w = TWO_PI * (c->hz + k * c->step);
            double at = w * tick * t->ticks - TWO_PI / 2 * k * (k + 1) / lines;
            t->c[k] = cos(at), t->s[k] = sin(at);
            t->turn_c[k] = cos(w * tick), t->turn_s[k] = sin(w * tick);
        }
        double pc = t->c[k], ps = t->s[k];
        sum += ps;
        t->c[k] = pc * t->turn_c[k] - ps * t->turn_s[k];
        t->s[k] = ps * t->turn_c[k] + pc * t->turn_s[k];
    }
    t->ticks++;
    return c->amplitude * sum;
}

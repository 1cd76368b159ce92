/* What goes into a law beside the readings: ramps, notch filters, injected tones. */
#ifndef SIGNAL_H
#define SIGNAL_H
#include "core.h"
#include "numbers.h"

static INLINE double toward(double from, double to, double step) {
    return to > from + step ? from + step : to < from - step ? from - step : to;
}

/* (s^2 + w^2)/(s^2 + s w/Q + w^2), transposed direct form II, of b0 = b2, b1 = a1 and a2 in `f`; a fresh one starts settled */
static INLINE double notched(const double *f, double *past, double in, int fresh) {
    if (fresh) {
        past[1] = (f[0] - f[2]) * in;
        past[0] = (1 - f[0]) * in;
    }
    double out = f[0] * in + past[0];
    past[0] = f[1] * in - f[1] * out + past[1];
    past[1] = f[0] * in - f[2] * out;
    return out;
}

/* what is injected: into which axis (below 0: none), with which amplitude, at hz, hz + step, ... */
typedef struct {
    double axis, amplitude, hz, lines, step;
} core_injection;
double core_injected(const core_injection *, core_tones *, double tick);
#endif

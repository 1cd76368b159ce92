/* The pulses of a mark. */
#include <math.h>
#include "mark.h"

static void pulse(core_tacho *t, double when) {
    t->earlier = t->before;
    t->before = t->last;
    t->last = when;
    t->pulses++;
    if (t->known < 2) t->known++;
}

/* Pulses between two angles of the shaft, timed by linear interpolation within the tick. A mark fires again only after
 * half a radian, so that a shaft that trembles at it gives one pulse. */
void core_ticked(const core_mark *m, core_tacho *t, double before, double after, int64_t at_tick, double tick) {
    const double marks[2] = {m->angle, m->angle - m->doubled};
    for (int k = 0; k < (m->doubled != 0 ? 2 : 1); k++) {
        double from = floor((before + marks[k]) / TWO_PI), to = floor((after + marks[k]) / TWO_PI);
        if (from == to) continue;
        double turn = most(from, to), mark = turn * TWO_PI - marks[k], share = (mark - before) / (after - before);
        if (fabs(mark - t->fired[k]) < 0.5) continue;
        t->fired[k] = mark;
        if (k == 0 && m->missing > 0 && fmod(turn, m->missing) == 0) continue;
        if (m->last > 0 && t->pulses >= m->last) continue;
        pulse(t, (at_tick + share) * tick);
    }
}

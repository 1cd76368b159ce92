/* The once-per-turn mark of a shaft, as the controller sees it. */
#ifndef MARK_H
#define MARK_H
#include "core.h"
#include "numbers.h"

/* a pulse when the shaft's angle + `angle` is a whole turn; defects: every `missing`-th does not come, a second one `doubled`
 * rad after it, none after `last` */
typedef struct {
    double angle, missing, doubled, last;
} core_mark;
void core_ticked(const core_mark *, core_tacho *, double before, double after, int64_t at_tick, double tick);

/* Speed from the last two pulses, less when the next is late, none below 2 Hz; and the share of a turn that is done since. */
static INLINE double read_mark(core_tacho *t, double now) {
    double age = now - t->last, period = t->last - t->before;
    t->age = age;
    t->counted = t->pulses;
    if (age > 0.5) t->known = 0;
    t->speed = t->known >= 2 ? TWO_PI / most(period, age) : 0;
    return t->known >= 2 ? least(age / period, 1) : 0;
}
#endif

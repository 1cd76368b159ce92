/* What the controller reads: probes with their errors and the journals' runout, coil currents, the once-per-turn mark. */
#include <math.h>
#include <string.h>
#include "mark.h"
#include "twin.h"

/* each probe's runout: sum of its columns times cos and sin of n phi, n = 1..4, which come from the angle addition theorem */
static INLINE void runout(const twin_params *p, const twin_derived *d, double *raw) {
    double c = d->turned.turn_c, s = d->turned.turn_s, cn = c, sn = s;
    for (int n = 0; n < 4; n++) {
        for (int b = 0; b < d->probe_blocks; b++) {
            int k = 4 * b;
            *(v4 *)(raw + k) += *(const v4 *)(p->runout_c + 16 * n + k) * cn + *(const v4 *)(p->runout_s + 16 * n + k) * sn;
        }
        double next = cn * c - sn * s;
        sn = sn * c + cn * s;
        cn = next;
    }
}

/* what each probe looks at: columns times coordinates */
static INLINE void look(const twin_params *p, const twin_derived *d, const double *s, double *raw) {
    const double q[8] = {s[Y], s[Z], s[PSI], s[THETA], s[12], s[13], s[14], s[15]};
    int n = d->flexible ? 8 : 4;
    for (int b = 0; b < d->probe_blocks; b++) {
        v4 sum = *(const v4 *)(p->probe_x + 4 * b) * s[X];
        for (int j = 0; j < n; j++) sum += *(const v4 *)(p->probe + 16 * j + 4 * b) * q[j];
        *(v4 *)(raw + 4 * b) = sum;
    }
}

void twin_sense(const twin_params *p, twin_derived *d, twin_state *st, double *position, double *coil) {
    double raw[16], noise[48] = {0};
    int axes = d->axes;
    if (st->s[5] != d->turned.angle) turned_to(&d->turned, st->s[5]);
    look(p, d, st->s, raw);
    if (d->runs_out) runout(p, d, raw);
    if (p->position_noise[0] > 0) core_draws(&st->noise, noise, p->probes);
    double wave = p->hum_hz > 0 ? sin(TWO_PI * fmod(p->hum_hz * p->tick * st->tick, 1)) : 0;
    for (int k = 0; k < p->probes; k++) {
        double y = p->position_sign[k] * (p->position_gain[k] * raw[k] + p->position_offset[k]);
        y += noise[k] * p->position_noise[k] + p->hum[k] * wave;
        double in = least(most(y, -p->position_range), p->position_range);
        if (in != y) st->flags |= OUT_OF_RANGE;
        position[k] = quantise(in, p->position_lsb, d->per_position_lsb);
    }
    if (p->current_noise > 0) core_draws(&st->noise, noise + 16, 2 * axes);
    for (int side = 0; side < 2; side++) {
        const double *drawn = noise + 16 + side * axes;
        for (int k = 0, j = 16 * side; k < axes; k++, j++) {
            double i = p->current_gain[j] * st->coil[j] + p->current_offset[j] + p->current_noise * drawn[k];
            coil[j] = quantise(i, p->current_lsb, d->per_current_lsb);
        }
    }
    double turn = read_mark(&st->tacho, st->tick * p->tick);
    st->tacho.angle = TWO_PI * (turn < 0.5 ? turn : turn - 1);
}

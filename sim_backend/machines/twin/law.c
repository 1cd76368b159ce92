/* The controller's law, a pure function of the readings, its own state and its parameters, called every tick: a PID for each
 * axis on the displacement at that axis, which the probes' readings give by a fixed map, less what notch filters take of it. */
#include <math.h>
#include <string.h>
#include "signal.h"
#include "twin.h"

/* displacements at the axes: sum over the probes of their columns times their readings */
static void locate(const twin_params *p, int blocks, const twin_control *c, const double *position, double *at) {
    for (int b = 0; b < blocks; b++) {
        v4 sum = {0};
        for (int k = 0; k < p->probes; k++) sum += *(const v4 *)(c->map + 16 * k + 4 * b) * position[k];
        *(v4 *)(at + 4 * b) = sum;
    }
}

static void filter(const twin_control *c, twin_law_state *l, int axes, double *at) {
    for (int m = 0; m < 2; m++) {
        const double *f = c->notch + 3 * m;
        if (f[0] == 0) continue;
        for (int k = 0; k < axes; k++) at[k] = notched(f, l->past + 32 * m + 2 * k, at[k], l->fresh);
    }
}

/* The integrators as they are when nothing is amiss: by F = beta (ip^2 - in^2)/gap^2 = 4 beta bias di/gap^2 of two coils at the
 * centre they hold the weight; one coil holds it with its bias. */
static void start(const twin_params *p, const twin_control *c, twin_law_state *l, const double *at) {
    int axes = p->radial + p->axial;
    memcpy(l->previous, at, sizeof l->previous);
    memset(l->filtered, 0, sizeof l->filtered);
    memcpy(l->rest, at, sizeof l->rest);
    memcpy(l->set_axis, c->ref_axis, sizeof l->set_axis);
    memcpy(l->set, c->ref, sizeof l->set);
    l->share = l->phase = 0;
    for (int k = 0; k < axes; k++) {
        double bias = c->bias[k], hold = c->hold[k];
        l->sum[k] = p->coils[k] == 1 ? sqrt(fmax(hold, 0)) - bias : bias > 0 ? clip(hold / (4 * bias), -bias, bias) : 0;
    }
    l->fresh = 0;
}

static void inject(const twin_params *p, const twin_control *c, twin_law_state *l, twin_reference *out) {
    core_injection asked = {c->inject_axis, c->inject_amplitude, c->inject_hz, c->inject_lines, c->inject_step};
    out->inject = core_injected(&asked, &l->tones, p->tick);
    if (c->inject_axis < 0) return;
    int last = p->radial + p->axial - 1, k = c->inject_axis > last ? last : (int)c->inject_axis, one = p->coils[k] == 1;
    double *plus = out->coil + k, *minus = out->coil + 16 + k;
    out->before = one ? *plus : (*plus - *minus) / 2;
    *plus = clip(*plus + out->inject, 0, c->current_limit);
    if (!one) *minus = clip(*minus - out->inject, 0, c->current_limit);
    out->after = one ? *plus : (*plus - *minus) / 2;
}

static void pid(const twin_params *p, const twin_control *c, twin_law_state *l, const double *at, twin_reference *out) {
    double r[16], v[16];
    int axes = p->radial + p->axial;
    twin_refer(p, c, l, r, v);
    for (int k = 0; k < axes; k++) {
        double bias = c->bias[k], most = p->coils[k] == 1 ? c->current_limit - bias : bias;
        double error = r[k] - at[k], di = c->kp[k] * error + l->sum[k] + c->kd[k] * (v[k] - l->filtered[k]);
        double inside = (di > -bias && di < most) || di * error < 0 ? p->tick : 0;
        l->sum[k] += c->ki[k] * error * inside;
        di = clip(di, -bias, most);
        out->coil[k] = clip(bias + di, 0, c->current_limit);
        out->coil[16 + k] = p->coils[k] == 1 ? 0 : clip(bias - di, 0, c->current_limit);
    }
}

void twin_law(const twin_params *p, const twin_derived *d, const twin_control *c, twin_law_state *l, const double *position,
              twin_reference *out) {
    double at[16] = {0}, keep = 1 / (1 + TWO_PI * c->derivative_hz * p->tick), gain = (1 - keep) * d->per_tick;
    memset(out, 0, sizeof *out);
    if (l->mode < LIFT && !l->fresh) return;
    locate(p, d->law_blocks, c, position, at);
    filter(c, l, d->axes, at);
    if (l->fresh) start(p, c, l, at);
    for (int k = 0; k < 4 * d->law_blocks; k++) {
        l->filtered[k] = keep * l->filtered[k] + gain * (at[k] - l->previous[k]);
        l->previous[k] = at[k];
    }
    if (l->mode < LIFT) return;
    int landed = l->mode == LAND && l->lift_clock >= c->lift_time_s;
    pid(p, c, l, at, out);
    inject(p, c, l, out);
    if (landed) memset(out, 0, sizeof *out);
}

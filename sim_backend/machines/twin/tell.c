/* What is told of a telemetry period and of a tick. */
#include <math.h>
#include <string.h>
#include "twin.h"

void twin_collect(const twin_derived *d, twin_state *st, const double *position, const double *coil) {
    int probes = 4 * d->probe_blocks, axes = d->axes;
    for (int k = 0; k < probes; k++) st->sums[AT_POSITION + k] += position[k];
    for (int k = 0; k < axes; k++) {
        double plus = st->voltage[k], minus = st->voltage[16 + k];
        st->sums[AT_CURRENT + k] += coil[k];
        st->sums[AT_CURRENT + 16 + k] += coil[16 + k];
        st->sums[AT_VOLTAGE + k] += plus;
        st->sums[AT_VOLTAGE + 16 + k] += minus;
        st->peak[k] = most(st->peak[k], most(fabs(plus), fabs(minus)));
    }
    st->inject += st->applied.inject;
    st->before += st->applied.before;
    st->after += st->applied.after;
}

/* What was collected of the period until now, but for its peaks. */
void twin_forget(twin_state *st) {
    memset(st->sums, 0, sizeof st->sums);
    st->inject = st->before = st->after = 0;
}

/* the mark's last edge, in whole microseconds of the device's time */
static double edge(const core_tacho *t) { return t->pulses > 0 ? floor(t->last * 1e6) * 1e-6 : 0; }

static void turned(const core_tacho *t, double *all) {
    all[AT_ANGLE] = t->angle;
    all[AT_SPEED] = t->speed;
    all[AT_PULSES] = (double)t->counted;
    all[AT_EDGE] = edge(t);
    all[AT_AGE] = t->age;
}

void twin_report(const twin_params *p, const twin_derived *d, twin_state *st, double *row) {
    double all[AT_END] = {0}, count = p->readings ? 1 : p->period;
    for (int k = 0; k < AT_PEAK; k++) all[k] = st->sums[k] / count;
    for (int k = 0; k < d->axes; k++) {
        double *peak = all + AT_PEAK + p->bearing[k];
        *peak = most(*peak, st->peak[k]);
    }
    turned(&st->tacho, all);
    all[AT_INJECT] = st->inject / count;
    all[AT_BEFORE] = st->before / count;
    all[AT_AFTER] = st->after / count;
    for (int k = 0; k < AT_NOTHING - AT_CONTACT; k++) all[AT_CONTACT + k] = st->flags >> k & 1;
    for (int k = 0; k < p->told; k++) row[k] = all[p->tell[k]];
    twin_forget(st);
    memset(st->peak, 0, sizeof st->peak);
    st->flags = st->in_period = 0;
}

void twin_record(const twin_params *p, const twin_state *st, const double *position, const double *coil, double *row) {
    double all[AT_END] = {0};
    memcpy(all + AT_POSITION, position, 16 * sizeof *all);
    memcpy(all + AT_CURRENT, coil, 32 * sizeof *all);
    memcpy(all + AT_VOLTAGE, st->voltage, 32 * sizeof *all);
    turned(&st->tacho, all);
    all[AT_INJECT] = st->applied.inject;
    all[AT_BEFORE] = st->applied.before;
    all[AT_AFTER] = st->applied.after;
    for (int k = 0; k < p->traced; k++) row[k] = all[p->trace[k]];
}

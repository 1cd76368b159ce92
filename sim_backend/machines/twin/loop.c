/* The sampled loop: sense, law, one sample of delay, amplifiers (exact) and mechanics (RK4), telemetry, trips. */
#include <math.h>
#include <string.h>
#include "mark.h"
#include "twin.h"

double twin_follow(const twin_params *p, int32_t axis, double current, double reference, double time) {
    return follow(p->inductance[axis], p->amplifier_rate, p->resistance, p->u_max, current, reference, time);
}

/* the references as the amplifiers' own sensors make them; the voltages at the start of the tick as they read them; whether any is limited */
static int amplifiers(const twin_params *p, const twin_derived *d, twin_state *st, double *to) {
    double limited = 0, asked = 0, on = st->law.mode != OFF;
    for (int side = 0; side < 32; side += 16) {
        for (int k = side; k < side + d->axes; k++) {
            double want = st->applied.coil[k], ref = least(most(want, 0), p->coil_limit);
            to[k] = on * most((ref - p->current_offset[k]) * d->per_gain[k], 0);
            if (st->coil[k] < 1e-30) st->coil[k] = 0;
            double u = d->pull[k] * (to[k] - st->coil[k]) + p->resistance * st->coil[k];
            limited = most(limited, fabs(u));
            asked = most(asked, want);
            st->voltage[k] = p->voltage_gain[k] * least(most(u, -p->u_max), p->u_max) + p->voltage_offset[k];
        }
    }
    if (asked >= p->coil_limit) st->flags |= CURRENT_LIMIT;
    if (limited <= p->u_max) return 0;
    st->flags |= VOLTAGE_LIMITED;
    return 1;
}

static INLINE void advance(const twin_params *p, const twin_derived *d, const double *from, const double *to, int limited, double h,
                           double keep, double *out) {
    if (limited) {
        for (int k = 0; k < 32; k++)
            out[k] = k % 16 < d->axes ? twin_follow(p, k % 16, from[k], to[k], h) : 0;
        return;
    }
    for (int b = 0; b < d->law_blocks; b++)
        for (int k = 4 * b; k < 32; k += 16)
            *(v4 *)(out + k) = *(const v4 *)(to + k) + (*(const v4 *)(from + k) - *(const v4 *)(to + k)) * keep;
}

static void step(const twin_params *p, const twin_derived *d, twin_state *st, const double *to, int limited, double h, double keep) {
    double c1[32], c2[32], k1[20], k2[20], k3[20], k4[20], at[20], *s = st->s;
    int n = d->flexible ? 20 : 12;
    advance(p, d, st->coil, to, limited, h / 2, keep, c1);
    advance(p, d, c1, to, limited, h / 2, keep, c2);
    twin_rates(p, d, s, st->coil, st->load, k1);
    for (int k = 0; k < n; k++) at[k] = s[k] + h / 2 * k1[k];
    twin_rates(p, d, at, c1, st->load, k2);
    for (int k = 0; k < n; k++) at[k] = s[k] + h / 2 * k2[k];
    twin_rates(p, d, at, c1, st->load, k3);
    for (int k = 0; k < n; k++) at[k] = s[k] + h * k3[k];
    twin_rates(p, d, at, c2, st->load, k4);
    for (int k = 0; k < n; k++) s[k] += h / 6 * (k1[k] + 2 * k2[k] + 2 * k3[k] + k4[k]);
    for (int k = 0; k < d->axes; k++) st->coil[k] = c2[k], st->coil[16 + k] = c2[16 + k];
}

/* how far the rings are away: whether the shaft may touch one within the tick (a free one gains less than 0.05 m/s) */
static int nears(const twin_params *p, const twin_derived *d, const double *s) {
    double y, z, sooner = 0.2 * p->tick > 2e-5 ? 0.2 * p->tick : 2e-5;
    if (fabs(s[X]) > p->stop - sooner) return 1;
    for (int k = 0; k < p->rings; k++) {
        twin_plane(d, s, p->ring[k], p->shape_ring + 2 * k, &y, &z);
        double vy = s[6 + Y] + p->ring[k] * s[6 + THETA], vz = s[6 + Z] - p->ring[k] * s[6 + PSI];
        double inside = most(p->clearance[k] - sooner, 0);
        if (y * y + z * z > inside * inside || vy * vy + vz * vz > 0.01) return 1;
    }
    return 0;
}

/* what is held over the tick: drive, drag, what hangs, a weight that has come loose, whether a ring or the stop is near */
static void hold(const twin_params *p, twin_state *st, twin_derived *d) {
    double left = st->drive_target - st->drive_speed, ramp = st->drive_ramp * p->tick, *s = st->s;
    st->drive_speed += least(most(left, -ramp), ramp);
    d->torque = driven(st->drive_gain, st->drive_limit, st->drive_speed, p->coulomb, p->coulomb_speed, s[11]);
    if (st->load_ticks > 0) {
        st->load_ticks--;
        for (int k = 0; k < 9; k++) st->load[k] += st->load_rate[k];
    }
    if (!st->loose && p->loose_speed > 0 && fabs(s[11]) > p->loose_speed) {
        st->loose = 1;
        twin_unbalance(p, st, d);
    }
    d->near = nears(p, d, s);
}

static void watch(const twin_params *p, const twin_derived *d, twin_state *st, const double *coil) {
    int trips = 0, lost = 0;
    double y, z, most_coil = 0;
    for (int k = 0; k < p->rings; k++) {
        twin_plane(d, st->s, p->ring[k], p->shape_ring + 2 * k, &y, &z);
        double square = y * y + z * z, edge = p->clearance[k] * p->clearance[k];
        if (square > edge) st->flags |= 1 << k;
        lost |= square > p->lost_share * p->lost_share * edge;
    }
    if (p->axial && fabs(st->s[X]) > p->stop) st->flags |= CONTACT_AXIAL;
    /* lost: never off the rings for 5 ms in all of lost_time; one that bounces is, one that brushes them is not */
    st->free_ticks = lost ? 0 : st->free_ticks + 1;
    st->lost_ticks = st->law.mode != LEVITATE || st->free_ticks > d->free_ticks ? 0 : st->lost_ticks + 1;
    if (st->lost_ticks * p->tick > p->lost_time) trips |= TRIP_LOST;
    for (int k = 0; k < d->axes; k++) most_coil = most(most_coil, most(fabs(coil[k]), fabs(coil[16 + k])));
    if (most_coil > p->trip_current) trips |= TRIP_CURRENT;
    if (st->tacho.speed > p->trip_speed) trips |= TRIP_SPEED;
    if (trips && !st->trips) {
        st->trip_tick = st->tick;
        if (trips & TRIP_LOST) st->law.mode = OFF;
    }
    st->trips |= trips;
}

void twin_start(const twin_params *p, twin_state *st, uint64_t seed) {
    memset(st, 0, sizeof *st);
    st->free_ticks = 1 << 30;
    core_noise_seed(&st->noise, seed, 0);
    double nearest = p->rings > 0 ? p->clearance[0] : 0, y = p->gravity[1], z = p->gravity[2];
    for (int k = 1; k < p->rings; k++) nearest = least(nearest, p->clearance[k]);
    double fy = p->free_radial[0] * y + p->free_radial[1] * z, fz = p->free_radial[1] * y + p->free_radial[2] * z;
    double g = sqrt(fy * fy + fz * fz); /* at rest on the nearest ring and on the stop */
    st->s[Y] = g > 1e-6 ? nearest * fy / g : 0;
    st->s[Z] = g > 1e-6 ? nearest * fz / g : 0;
    st->s[X] = p->axial && fabs(p->gravity[0]) > 1e-6 ? copysign(p->stop, p->gravity[0]) : 0;
    st->s[5] = p->start_angle;
    st->tacho.fired[0] = st->tacho.fired[1] = -1e9;
}

/* Runs `ticks` control ticks, or fewer when a trip occurs (then to the end of the telemetry period). Each completed
 * period appends `told` numbers to `rows`; every `every`-th tick (0: none) appends `traced` readings to `trace`.
 * Returns the number of ticks run. */
int64_t twin_run(const twin_params *p, const twin_control *c, twin_state *st, int64_t ticks, double *rows, int64_t row_limit,
                 double *trace, int64_t every) {
    int64_t done = 0, filled = 0, kept = 0;
    int before = st->trips;
    double position[16] = {0}, coil[32] = {0}, to[32] = {0};
    twin_derived d;
    twin_derive(p, &d);
    twin_unbalance(p, st, &d);
    turned_to(&d.turned, st->s[5]);
    const core_mark mark = {p->pulse_angle, p->pulse_missing, p->pulse_doubled, p->pulse_last};
    while (done < ticks && (filled < row_limit || st->in_period)) {
        twin_sense(p, &d, st, position, coil);
        st->applied = st->next; /* one sample of delay */
        twin_law(p, &d, c, &st->law, position, &st->next);
        watch(p, &d, st, coil);
        int limited = amplifiers(p, &d, st, to);
        if (p->readings) twin_forget(st);
        twin_collect(&d, st, position, coil);
        if (every && st->tick % every == 0) twin_record(p, st, position, coil, trace + p->traced * kept++);
        hold(p, st, &d);
        int way = d.near ? 2 : limited, steps = d.steps[way];
        for (int k = 0; k < steps; k++) step(p, &d, st, to, limited, p->tick / steps, d.keep[way]);
        if (st->s[5] != d.turned.angle) core_ticked(&mark, &st->tacho, d.turned.angle, st->s[5], st->tick, p->tick);
        st->tick++;
        done++;
        if (++st->in_period == p->period) {
            twin_report(p, &d, st, rows + p->told * filled++);
            if (st->trips & ~before) break;
        }
    }
    return done;
}

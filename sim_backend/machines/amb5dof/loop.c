/* The sampled loop: sense, law, one sample of delay, amplifiers (exact) and mechanics (RK4), telemetry, trace, trips. */
#include <math.h>
#include <string.h>
#include "amb5dof.h"
#include "mark.h"

/* each sensor's runout: sum a_n cos(n phi + p_n), n = 1..4 */
static void runout(const amb_derived *d, double *raw) {
    double c[4], s[4];
    tsbs_turn(d->turned.angle, c, s);
    for (int k = 0; k < 4; k++)
        for (int n = 0; n < 4; n++) raw[k] += d->runout_c[4 * k + n] * c[n] - d->runout_s[4 * k + n] * s[n];
}

void amb_sense(const amb_params *p, amb_derived *d, amb_state *st, amb_reading *r, double *coil) {
    double raw[5];
    turned_to(&d->turned, st->s[5]);
    int swap = p->exchange_planes != 0;
    for (int b = 0; b < 2; b++) {
        double *at = raw + 2 * (b ^ swap);
        amb_plane(d, st->s, d->sensor[b] - st->s[X], p->shape_sensor + b, at, at + 1);
    }
    raw[4] = st->s[X];
    if (d->runs_out) runout(d, raw);
    for (int k = 0; p->exchange_axes != 0 && k < 4; k += 2) {
        double y = raw[k];
        raw[k] = raw[k + 1], raw[k + 1] = y;
    }
    double wave = p->hum_hz > 0 ? sin(TWO_PI * fmod(p->hum_hz * TICK * st->tick, 1)) : 0;
    for (int k = 0; k < 5; k++) {
        double noise = p->position_noise > 0 ? p->position_noise * core_normal(&st->noise) : 0;
        double y = p->position_sign[k] * (p->position_gain[k] * raw[k] + p->position_offset[k]) + noise + p->hum[k] * wave;
        if (fabs(y) > p->position_range) st->flags |= CLIPPED;
        y = least(most(y, -p->position_range), p->position_range);
        r->position[k] = quantise(y, p->position_lsb, d->per_position_lsb);
    }
    for (int k = 0; k < 10; k++) {
        double noise = p->current_noise > 0 ? p->current_noise * core_normal(&st->noise) : 0;
        double i = p->current_gain[k] * st->coil[k] + p->current_offset[k] + noise;
        coil[k] = quantise(i, p->current_lsb, d->per_current_lsb);
    }
    double share = read_mark(&st->tacho, st->tick * TICK);
    st->tacho.angle = TWO_PI * (st->tacho.pulses + share);
    r->speed = st->tacho.speed;
}

double amb_follow(const amb_params *p, double current, double reference, double time) {
    return follow(p->inductance, p->amplifier_rate, p->resistance, p->u_max, current, reference, time);
}

/* the references as the amplifiers' own sensors make them; the voltages at the start of the tick as they read them; whether any is limited */
static int amplifiers(const amb_params *p, const amb_derived *d, amb_state *st, double *to) {
    double lw = p->inductance * p->amplifier_rate, limited = 0;
    int enabled = st->law.mode != OFF;
    for (int k = 0; k < 10; k++) {
        double ref = enabled ? least(most(st->applied.coil[k], 0), p->coil_limit) : 0;
        if (st->coil[k] < 1e-30) st->coil[k] = 0;
        to[k] = enabled ? most((ref - p->current_offset[k]) * d->per_gain[k], 0) : 0;
        double u = lw * (to[k] - st->coil[k]) + p->resistance * st->coil[k];
        limited = most(limited, fabs(u));
        st->voltage[k] = p->voltage_gain[k] * least(most(u, -p->u_max), p->u_max) + p->voltage_offset[k];
        if (st->applied.coil[k] >= p->coil_limit) st->flags |= SATURATED;
    }
    if (limited <= p->u_max) return 0;
    st->flags |= VOLTAGE_LIMIT;
    return 1;
}

static void advance(const amb_params *p, const double *from, const double *to, int limited, double h, double keep, double *out) {
    for (int k = 0; k < 10; k++)
        out[k] = limited ? amb_follow(p, from[k], to[k], h) : to[k] + (from[k] - to[k]) * keep;
}

static void step(const amb_params *p, const amb_derived *d, amb_state *st, const double *to, int limited, double h, double keep) {
    double c1[10], c2[10], k1[20], k2[20], k3[20], k4[20], at[20], *s = st->s;
    int n = d->flexible ? 20 : 12;
    advance(p, st->coil, to, limited, h / 2, keep, c1);
    advance(p, c1, to, limited, h / 2, keep, c2);
    amb_rates(p, d, s, st->coil, k1);
    for (int k = 0; k < n; k++) at[k] = s[k] + h / 2 * k1[k];
    amb_rates(p, d, at, c1, k2);
    for (int k = 0; k < n; k++) at[k] = s[k] + h / 2 * k2[k];
    amb_rates(p, d, at, c1, k3);
    for (int k = 0; k < n; k++) at[k] = s[k] + h * k3[k];
    amb_rates(p, d, at, c2, k4);
    for (int k = 0; k < n; k++) s[k] += h / 6 * (k1[k] + 2 * k2[k] + 2 * k3[k] + k4[k]);
    memcpy(st->coil, c2, sizeof c2);
}

/* what is held over the tick: drive, drag, a weight that has come loose, whether a ring or the stop is near */
static void hold(const amb_params *p, amb_state *st, amb_derived *d) {
    double left = st->drive_target - st->drive_speed, ramp = st->drive_ramp * TICK, *s = st->s, y, z;
    st->drive_speed += least(most(left, -ramp), ramp);
    d->torque = driven(st->drive_gain, st->drive_limit, st->drive_speed, p->coulomb, p->coulomb_speed, s[11]);
    if (!st->loose && p->loose_speed > 0 && fabs(s[11]) > p->loose_speed) {
        st->loose = 1;
        amb_unbalance(p, st, d);
    }
    d->near = fabs(s[X]) > p->stop - 2e-5;
    for (int b = 0; b < 2; b++) { /* a free shaft gains less than 0.05 m/s in a tick */
        amb_plane(d, s, d->sensor[b], p->shape_sensor + b, &y, &z);
        double vy = s[6 + Y] + d->sensor[b] * s[6 + THETA], vz = s[6 + Z] - d->sensor[b] * s[6 + PSI];
        double inside = p->clearance - 2e-5;
        d->near |= y * y + z * z > inside * inside || vy * vy + vz * vz > 0.01;
    }
}

static void watch(const amb_params *p, const amb_derived *d, amb_state *st, const double *coil) {
    int trips = 0, lost = 0;
    double y, z;
    for (int b = 0; b < 2; b++) {
        amb_plane(d, st->s, d->sensor[b], p->shape_sensor + b, &y, &z);
        double square = y * y + z * z;
        if (square > p->clearance * p->clearance) st->flags |= b ? CONTACT_O : CONTACT_I;
        lost |= square > p->lost_radius * p->lost_radius;
    }
    if (fabs(st->s[X]) > p->stop) st->flags |= CONTACT_X;
    /* lost: never off the rings for 5 ms in all of lost_time; one that bounces is, one that brushes them is not */
    st->free_ticks = lost ? 0 : st->free_ticks + 1;
    st->lost_ticks = st->law.mode != LEVITATE || st->free_ticks > 50 ? 0 : st->lost_ticks + 1;
    if (st->lost_ticks * TICK > p->lost_time) trips |= TRIP_LOST;
    for (int k = 0; k < 10; k++)
        if (fabs(coil[k]) > p->trip_current) trips |= TRIP_CURRENT;
    if (st->tacho.speed > p->trip_speed) trips |= TRIP_SPEED;
    if (trips && !st->trips) {
        st->trip_tick = st->tick;
        if (trips & TRIP_LOST) st->law.mode = OFF;
    }
    st->trips |= trips;
}

static void collect(amb_state *st, const amb_reading *r, const double *coil) {
    for (int k = 0; k < 5; k++) st->sums[k] += r->position[k];
    for (int k = 0; k < 10; k++) {
        st->sums[5 + k] += coil[k];
        st->peak[k / 4] = most(st->peak[k / 4], fabs(st->voltage[k]));
    }
    st->sums[15] += st->applied.inject;
}

static void report(amb_state *st, double *row) {
    for (int k = 0; k < 5; k++) row[k] = st->sums[k] / PERIOD;
    row[5] = st->tacho.angle;
    row[6] = st->tacho.speed;
    for (int k = 0; k < 10; k++) row[7 + k] = st->sums[5 + k] / PERIOD;
    for (int k = 0; k < 3; k++) row[17 + k] = st->peak[k];
    row[20] = (double)st->tacho.counted;
    row[21] = st->tacho.age;
    row[22] = st->sums[15] / PERIOD;
    row[23] = st->flags;
    memset(st->sums, 0, sizeof st->sums);
    memset(st->peak, 0, sizeof st->peak);
    st->flags = st->in_period = 0;
}

static void record(const amb_state *st, const amb_reading *r, const double *coil, double *row) {
    memcpy(row, r->position, sizeof r->position);
    memcpy(row + 5, coil, 10 * sizeof *coil);
    memcpy(row + 15, st->voltage, sizeof st->voltage);
    row[25] = st->applied.inject;
    row[26] = st->applied.before;
    row[27] = st->applied.after;
    row[28] = st->tacho.angle;
    row[29] = st->tacho.speed;
    row[30] = (double)st->tacho.counted;
    row[31] = st->tacho.age;
}

void amb_start(const amb_params *p, const amb_control *c, amb_state *st, uint64_t seed) {
    int substeps = st->substeps;
    memset(st, 0, sizeof *st);
    (void)c;
    st->substeps = substeps > 0 ? substeps : 2;
    st->free_ticks = 51;
    core_noise_seed(&st->noise, seed, 0);
    double g = sqrt(p->gravity_y * p->gravity_y + p->gravity_z * p->gravity_z); /* at rest on both rings */
    st->s[Y] = g > 0 ? p->clearance * p->gravity_y / g : 0;
    st->s[Z] = g > 0 ? p->clearance * p->gravity_z / g : 0;
}

/* Runs `ticks` control ticks, or fewer when a trip occurs (then to the end of the telemetry period). Each completed
 * period appends AMB_COLUMNS numbers to `rows`; every `every`-th tick (0: none) appends AMB_TRACE readings to `trace`.
 * Returns the number of ticks run. */
int64_t amb_run(const amb_params *p, const amb_control *c, amb_state *st, int64_t ticks, double *rows, int64_t row_limit,
                double *trace, int64_t every) {
    int64_t done = 0, filled = 0, kept = 0;
    int before = st->trips;
    amb_derived d;
    amb_derive(p, st->substeps, &d);
    amb_unbalance(p, st, &d);
    const core_mark mark = {p->pulse_angle, p->pulse_missing, p->pulse_doubled, p->pulse_last};
    while (done < ticks && (filled < row_limit || st->in_period)) {
        amb_reading r;
        double coil[10], to[10];
        amb_sense(p, &d, st, &r, coil);
        st->applied = st->next; /* one sample of delay */
        amb_law(c, &st->law, &r, &st->next);
        watch(p, &d, st, coil);
        int limited = amplifiers(p, &d, st, to);
        collect(st, &r, coil);
        if (every && st->tick % every == 0) record(st, &r, coil, trace + AMB_TRACE * kept++);
        hold(p, st, &d);
        int way = d.near ? 2 : limited, steps = d.steps[way];
        for (int k = 0; k < steps; k++) step(p, &d, st, to, limited, TICK / steps, d.keep[way]);
        if (st->s[5] != d.turned.angle) core_ticked(&mark, &st->tacho, d.turned.angle, st->s[5], st->tick, TICK);
        st->tick++;
        done++;
        if (++st->in_period == PERIOD) {
            report(st, rows + AMB_COLUMNS * filled++);
            if (st->trips & ~before) break;
        }
    }
    return done;
}

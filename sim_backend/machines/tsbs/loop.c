/* The sampled loop: sense, law, one-sample delay, amplifiers (exact) and mechanics (RK4), telemetry means, trips. */
#include <math.h>
#include <string.h>
#include "numbers.h"
#include "tsbs.h"

static double plane(const double *s, double z, int axis) { return axis ? s[1] - z * s[3] : s[0] + z * s[4]; }

/* a segment's current along the field as the sensors have it, and across it */
static double along(const tsbs_derived *d, const tsbs_state *st, int k) {
    return st->segment[k] * d->sensed_c + st->segment[k + 4] * d->sensed_s;
}

static double across(const tsbs_derived *d, const tsbs_state *st, int k) {
    return st->segment[k + 4] * d->sensed_c - st->segment[k] * d->sensed_s;
}

void tsbs_sense(const tsbs_params *p, tsbs_derived *d, tsbs_state *st, tsbs_reading *r, double *coil, double *segment) {
    const double *s = st->s;
    double raw[5], tc[4], ts[4];
    tsbs_at(d, s[5], tc, ts);
    for (int b = 0; b < 2; b++) {
        double qy, qx = tsbs_harmonics(d->target_c + 4 * b, d->target_s + 4 * b, tc, ts, &qy);
        int swap = p->exchange_axes[b] != 0;
        raw[2 * b + swap] = plane(s, p->z_sensor[b], 0) + qx;
        raw[2 * b + !swap] = plane(s, p->z_sensor[b], 1) + qy;
    }
    raw[4] = s[2];
    double normal[19];
    if (p->position_noise > 0) core_draws(&st->noise, normal, 5);
    else memset(normal, 0, 5 * sizeof *normal);
    if (p->current_noise > 0) core_draws(&st->noise, normal + 5, 14);
    else memset(normal + 5, 0, 14 * sizeof *normal);
    for (int k = 0; k < 5; k++) {
        double noise = p->position_noise * normal[k];
        double y = p->position_sign[k] * (p->position_gain[k] * raw[k] + p->position_offset[k]) + noise;
        r->position[k] = p->stuck[k] != 0 ? p->stuck_value : quantise(y, p->position_lsb, d->per_position_lsb);
    }
    double now = st->tick * TICK;
    for (int k = 0; k < 10; k++) {
        double noise = p->current_noise * normal[5 + k];
        double i = p->current_gain[k] * st->coil[k] + p->current_offset[k] + p->current_drift[k] * now + noise;
        coil[k] = quantise(i, p->current_lsb, d->per_current_lsb);
    }
    double scale = 1 + p->segment_scale_drift * now; /* of what the four sensors share */
    tsbs_reference field = {.gamma = st->applied.gamma};
    tsbs_commutate(p, d, &field);
    d->sensed_c = field.turn_c;
    d->sensed_s = field.turn_s;
    for (int k = 0; k < 4; k++) {
        double noise = p->current_noise * normal[15 + k];
        double of = p->phases == 6 && k % 2 ? across(d, st, k - 1) : along(d, st, k);
        double i = scale * p->segment_sense[k] * of + p->segment_offset[k] + p->segment_drift[k] * now + noise;
        segment[k] = quantise(i, p->current_lsb, d->per_current_lsb);
    }
    double angle = p->encoder_sign * (s[5] + p->encoder_offset);
    r->angle = p->encoder_counts > 0 ? floor(angle * p->encoder_counts / 6.283185307179586 + 0.5) *
                                           6.283185307179586 / p->encoder_counts
                                     : angle;
}

static double size(const tsbs_reference *r, int k) {
    return r->across[k] != 0 ? sqrt(r->segment[k] * r->segment[k] + r->across[k] * r->across[k]) : fabs(r->segment[k]);
}

static void amplifiers(const tsbs_params *p, const tsbs_derived *d, tsbs_state *st, double *coil, double *segment) {
    double now = st->tick * TICK;
    int enabled = st->law.mode != OFF;
    for (int k = 0; k < 10; k++) /* a current that has died away is none: denormal numbers are slow */
        if (st->coil[k] < 1e-30) st->coil[k] = 0;
    for (int k = 0; k < 8; k++)
        if (fabs(st->segment[k]) < 1e-30) st->segment[k] = 0;
    for (int k = 0; k < 10; k++) { /* the inner loop closes on its own sensor */
        double ref = enabled ? least(most(st->applied.coil[k], 0), p->coil_limit[k]) : 0;
        coil[k] = enabled ? most((ref - p->current_offset[k] - p->current_drift[k] * now) * d->per_gain[k], 0) : 0;
    }
    double per_scale = 1 / (1 + p->segment_scale_drift * now);
    for (int k = 0; k < 4; k++) {
        const tsbs_reference *r = &st->applied;
        double whole = size(r, k), part = whole > p->segment_limit ? p->segment_limit / whole : 1;
        int q = p->phases == 6 ? k - k % 2 : k; /* six: sensors 0, 2 of q and 1, 3 of d, each of a pair */
        double error = p->segment_offset[q] + p->segment_drift[q] * now, per = enabled ? d->per_sense[q] * per_scale : 0;
        double i_q = (r->segment[k] * part - error) * per, i_d = r->across[k] * part;
        if (p->phases == 6) i_d -= p->segment_offset[q + 1] + p->segment_drift[q + 1] * now;
        i_d *= p->phases == 6 ? (enabled ? d->per_sense[q + 1] * per_scale : 0) : per;
        segment[k] = i_q * r->turn_c - i_d * r->turn_s;
        segment[k + 4] = i_q * r->turn_s + i_d * r->turn_c;
    }
}

static void approach(const double *from, const double *to, int n, double keep, double *out) {
    for (int k = 0; k < n; k++) out[k] = to[k] + (from[k] - to[k]) * keep;
}

/* `mixed`: what acts of the segments, which goes to `mixed_to` by their one rate */
static void step(const tsbs_params *p, const tsbs_derived *d, tsbs_state *st, const double *coil_to, double *mixed,
                 const double *mixed_to, double h) {
    double c1[10], c2[10], g1[8], g2[8], k1[14], k2[14], k3[14], k4[14], at[14];
    double w0 = st->weight, w1 = w0, w2 = w0;
    if (st->weight_rate > 0) {
        double left = st->weight_to - w0, step = st->weight_rate * h;
        w2 = w0 + (left > step ? step : left < -step ? -step : left);
        w1 = (w0 + w2) / 2;
    }
    double half = d->coil_keep, seg = d->segment_keep;
    approach(st->coil, coil_to, 10, half, c1);
    approach(c1, coil_to, 10, half, c2);
    approach(mixed, mixed_to, 8, seg, g1);
    approach(g1, mixed_to, 8, seg, g2);
    double *s = st->s, m = st->hung_mass;
    tsbs_rates(p, d, s, st->coil, mixed, st->play, m, w0, k1);
    for (int k = 0; k < 14; k++) at[k] = s[k] + h / 2 * k1[k];
    tsbs_rates(p, d, at, c1, g1, st->play, m, w1, k2);
    for (int k = 0; k < 14; k++) at[k] = s[k] + h / 2 * k2[k];
    tsbs_rates(p, d, at, c1, g1, st->play, m, w1, k3);
    for (int k = 0; k < 14; k++) at[k] = s[k] + h * k3[k];
    tsbs_rates(p, d, at, c2, g2, st->play, m, w2, k4);
    for (int k = 0; k < 14; k++) s[k] += h / 6 * (k1[k] + 2 * k2[k] + 2 * k3[k] + k4[k]);
    memcpy(st->coil, c2, sizeof c2);
    memcpy(mixed, g2, sizeof g2);
    st->weight = w2;
}

/* play operator on the control current, once per tick: what is left of it lags in the force by at most `hysteresis` */
static void hysteresis(const tsbs_params *p, tsbs_state *st) {
    for (int a = 0; a < 4; a++) {
        double control = (st->coil[2 * a] - st->coil[2 * a + 1]) / 2, *follow = st->follow + a;
        *follow = least(most(*follow, control - p->hysteresis), control + p->hysteresis);
        st->play[a] = control - *follow;
    }
}

/* the external drive's speed goes to its target; it is held over the tick */
static void drive(tsbs_state *st, tsbs_derived *d) {
    double left = st->drive_target - st->drive_speed, step = st->drive_ramp * TICK;
    st->drive_speed += least(most(left, -step), step);
    d->drive_gain = st->drive_gain;
    d->drive_limit = st->drive_limit;
    d->drive_speed = st->drive_speed;
}

static double near_to(double x, double goal, double step) { return x + least(most(goal - x, -step), step); }

/* what holds over the tick: the lever's weight is handed over gradually, and it may slip */
static void hold(const tsbs_params *p, tsbs_state *st, tsbs_derived *d) {
    st->lever_weight = near_to(st->lever_weight, st->lever_weight_to, st->lever_weight_rate * TICK);
    st->lever_moment = near_to(st->lever_moment, st->lever_moment_to, st->lever_moment_rate * TICK);
    if (p->lever_slip != 0) st->slip += p->lever_slip * st->lever_moment * cos(st->s[5] + st->slip) * TICK;
    double lever[4] = {st->lever_weight, st->lever_moment, st->slip, st->lever_inertia + st->ring_inertia};
    tsbs_hold(p, st->coil, lever, d);
    d->near = 0; /* a free rotor gains less than 0.1 m/s in a tick */
    for (int b = 0; b < 2; b++) {
        double z = p->z_sensor[b], x = plane(st->s, z, 0) - p->ring_x[b], y = plane(st->s, z, 1) - p->ring_y[b];
        double vx = st->s[6] + z * st->s[10], vy = st->s[7] - z * st->s[9];
        double inside = p->clearance - 2e-5;
        if (x * x + y * y > inside * inside || vx * vx + vy * vy > 0.01) d->near = 1;
    }
}

/* An end that the motor is to lift is no end that was lost as long as it has not left its ring. */
static void watch(const tsbs_params *p, const tsbs_control *c, tsbs_state *st, const double *coil, double speed) {
    int trips = 0, lost = 0, held = st->law.mode == LEVITATE;
    for (int b = 0; b < 2; b++) {
        double x = plane(st->s, p->z_sensor[b], 0) - p->ring_x[b], y = plane(st->s, p->z_sensor[b], 1) - p->ring_y[b];
        double square = x * x + y * y;
        if (square > p->clearance * p->clearance) st->flags |= b ? CONTACT_O : CONTACT_I;
        if (b) st->freed = held && (st->freed || 4 * square < p->clearance * p->clearance);
        if (!b || c->lift_by == 0 || st->freed) lost |= square > p->lost_radius * p->lost_radius;
    }
    /* a rotor that bounces between the rings is lost too: a tick outside counts two, a tick inside takes one back */
    st->lost_ticks = !held ? 0 : lost ? st->lost_ticks + 2 : st->lost_ticks > 0 ? st->lost_ticks - 1 : 0;
    if (st->lost_ticks * TICK > 2 * p->lost_time) trips |= TRIP_LOST;
    for (int k = 0; k < 10; k++) {
        if (fabs(coil[k]) > p->trip_current) trips |= TRIP_CURRENT;
        if (st->applied.coil[k] >= p->coil_limit[k]) st->flags |= SATURATED;
    }
    for (int k = 0; k < 4; k++)
        if (size(&st->applied, k) > p->segment_limit) st->flags |= SEGMENT_SATURATED;
    if (fabs(speed) > p->trip_speed) trips |= TRIP_SPEED;
    if (trips && !st->trips) {
        st->trip_tick = st->tick;
        if (trips & TRIP_LOST) st->law.mode = OFF; /* the rings hold it now; current would only fight them */
    }
    st->trips |= trips;
}

/* What a capture records of one tick, TRACE numbers: five positions, angle within a turn, speed, four segments along the field as
 * the telemetry has them, four across it, which in an ideal drive are nothing; gamma and of what the law has just asked for i_x,
 * i_y, torque current asked and given, its bound, lambda, and the observer's loads. */
static void record(const tsbs_params *p, const tsbs_derived *d, tsbs_state *st, const tsbs_reading *r, const double *segment,
                   double *out) {
    const tsbs_law_state *l = &st->law;
    double normal[4] = {0}, scale = 1 + p->segment_scale_drift * st->tick * TICK;
    if (p->current_noise > 0) core_draws(&st->across_noise, normal, 4);
    memcpy(out, r->position, sizeof r->position);
    out[5] = remainder(r->angle, TWO_PI);
    out[6] = st->speed;
    memcpy(out + 7, segment, 4 * sizeof *segment);
    for (int k = 0; k < 4; k++) {
        double i = scale * p->segment_sense[k] * across(d, st, k) + p->current_noise * normal[k];
        out[11 + k] = quantise(i, p->current_lsb, d->per_current_lsb);
    }
    out[15] = l->gamma;
    memset(out + 16, 0, 8 * sizeof *out);
    if (l->mode >= LIFT) memcpy(out + 16, l->told, sizeof l->told);
    if (l->mode >= LIFT && l->share > 0) memcpy(out + 22, l->load, sizeof l->load);
}

void tsbs_start(const tsbs_params *p, const tsbs_control *c, tsbs_state *st, uint64_t seed) {
    int substeps = st->substeps;
    memset(st, 0, sizeof *st);
    (void)c;
    st->substeps = substeps > 0 ? substeps : 2;
    core_noise_seed(&st->noise, seed, 0);
    core_noise_seed(&st->across_noise, seed, 1);
    double zi = p->z_sensor[0], zo = p->z_sensor[1], yi = p->ring_y[0] - p->clearance, yo = p->ring_y[1] - p->clearance;
    st->s[3] = (yi - yo) / (zo - zi); /* T (6.7): at rest on both rings */
    st->s[1] = yi + zi * st->s[3];
    st->s[0] = (p->ring_x[0] * zo - p->ring_x[1] * zi) / (zo - zi);
    st->s[4] = (p->ring_x[1] - p->ring_x[0]) / (zo - zi);
    st->angle_before = st->s[5];
    st->next.turn_c = 1;
}

/* Runs `ticks` control ticks, or fewer when a trip occurs (then to the end of the telemetry period). Each completed
 * period appends COLUMNS numbers to `rows`: means of 5 positions, angle (last), speed, 10 coils, 4 segments, flags; every
 * `every`-th tick (0: none) appends TRACE readings to `trace`. Returns the number of ticks run. */
int64_t tsbs_run(const tsbs_params *p, const tsbs_control *c, tsbs_state *st, int64_t ticks, double *rows,
                 int64_t row_limit, double *trace, int64_t every) {
    int64_t done = 0, filled = 0, kept = 0;
    int before = st->trips;
    tsbs_derived d;
    tsbs_derive(p, TICK / st->substeps, &d);
    tsbs_gains g;
    tsbs_settle(c, &g);
    while (done < ticks && (filled < row_limit || st->in_period)) {
        tsbs_reading r;
        double coil[10], segment[4], coil_to[10], segment_to[8];
        tsbs_sense(p, &d, st, &r, coil, segment);
        st->applied = st->next; /* one sample of delay */
        tsbs_act(c, &g, &st->law, &r, &st->next);
        tsbs_commutate(p, &d, &st->next);
        st->speed = d.speed_keep * st->speed + (1 - d.speed_keep) * (r.angle - st->angle_before) / TICK;
        st->angle_before = r.angle;
        if (every && st->tick % every == 0) record(p, &d, st, &r, segment, trace + TRACE * kept++);
        watch(p, c, st, coil, st->speed);
        for (int k = 0; k < 5; k++) st->sums[k] += r.position[k];
        st->sums[5] = r.angle;
        st->sums[6] += st->speed;
        for (int k = 0; k < 10; k++) st->sums[7 + k] += coil[k];
        for (int k = 0; k < 4; k++) st->sums[17 + k] += segment[k];
        amplifiers(p, &d, st, coil_to, segment_to);
        hysteresis(p, st);
        drive(st, &d);
        hold(p, st, &d);
        double mixed[8], mixed_to[8];
        tsbs_mix(p, st->segment, mixed);
        tsbs_mix(p, segment_to, mixed_to);
        for (int k = 0; k < st->substeps; k++) step(p, &d, st, coil_to, mixed, mixed_to, TICK / st->substeps);
        approach(st->segment, segment_to, 8, d.segment_tick, st->segment);
        st->tick++;
        done++;
        if (++st->in_period == PERIOD) {
            double *row = rows + COLUMNS * filled++;
            for (int k = 0; k < 21; k++) row[k] = k == 5 ? st->sums[5] : st->sums[k] / PERIOD;
            row[21] = st->flags;
            memset(st->sums, 0, sizeof st->sums);
            st->flags = st->in_period = 0;
            if (st->trips & ~before) break;
        }
    }
    return done;
}

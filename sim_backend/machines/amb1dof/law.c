/* Control law: velocity by an estimator, disturbance by the reduced observer (4.22) or everything by the full one (4.21), feedback
 * (4.20), currents by the branch-free inverse of (2.25). A function of the reading and of its own state, every 100 us. */
#include <math.h>
#include <string.h>
#include "amb1dof.h"
#include "numbers.h"
#include "signal.h"

double amb1_force(double beta, double gap, double y, double positive, double negative) {
    double p = positive / (gap - y), n = negative / (gap + y);
    return beta * (p * p - n * n);
}

/* T (2.25) for one axis, with one root instead of a case for each side; where a coil would be negative, the end of the range */
double amb1_ccs(double force, double beta, double gap, double y, double bias) {
    double near = gap - y, far = gap + y, f = force / beta, most_square = 4 * bias * bias, both = near * far;
    if (f * near * near >= most_square) return bias;
    if (f * far * far <= -most_square) return -bias;
    double root = sqrt(most(bias * bias + gap * y * f, 0));
    return (f * both * both - gap * y * most_square) / (2 * ((gap * gap + y * y) * bias + both * root));
}

/* s^n + c[1] s^(n - 1) + ... of its roots */
static void polynomial(const double *roots, int n, double *c) {
    memset(c, 0, (n + 1) * sizeof *c);
    c[0] = 1;
    for (int k = 0; k < n; k++)
        for (int j = k + 1; j > 0; j--) c[j] -= roots[k] * c[j - 1];
}

/* h_1..h_3 of s^3 + (h_1 + h_2) s^2 + (h_3 + w^2) s + h_1 w^2; l_1..l_5 of s^5 + l_1 s^4 + (l_2 + w^2) s^3 + (l_1 w^2 + (l_3 + l_4)/m) s^2
 * + (l_2 w^2 + l_5/m) s + l_3 w^2/m */
void amb1_gains(const amb1_control *c, double *reduced, double *full) {
    double w = TWO_PI * c->harmonic_hz, square = w * w, m = c->model_mass, a[6];
    const double few[3] = {c->pole_slow, c->pole_fast, c->pole_fast};
    polynomial(few, 3, a);
    reduced[0] = a[3] / square;
    reduced[1] = a[1] - reduced[0];
    reduced[2] = a[2] - square;
    const double many[5] = {c->pole_full, c->pole_full, c->pole_slow, c->pole_fast, c->pole_fast};
    polynomial(many, 5, a);
    full[0] = a[1];
    full[1] = a[2] - square;
    full[2] = a[5] * m / square;
    full[3] = (a[3] - full[0] * square) * m - full[2];
    full[4] = (a[4] - full[1] * square) * m;
}

/* what is told of the disturbance: (4.22) with the velocity as it is estimated */
static void told(const amb1_control *c, amb1_law_state *l, double velocity, const double *h) {
    double momentum = c->model_mass * velocity;
    l->load[0] = l->reduced[0] + h[0] * momentum;
    l->harmonic[0] = l->reduced[1] + h[1] * momentum;
    l->load[1] = l->full[2];
    l->harmonic[1] = l->full[3];
    l->estimate[FULL] = l->full[1];
}

/* explicit Euler, with the current just sent; `exact_rotation`: the harmonic turns by cos and sin of a sample instead */
static void observe(const amb1_control *c, amb1_law_state *l, double y, double force, double velocity, const double *h,
                    const double *g) {
    double w = TWO_PI * c->harmonic_hz, m = c->model_mass, sum = force + l->load[0] + l->harmonic[0], e = y - l->full[0];
    double rate[3] = {-h[0] * sum, -h[1] * sum, -h[2] * sum};
    double full[5] = {l->full[1] + g[0] * e, (force + l->full[2] + l->full[3]) / m + g[1] * e, g[2] * e, g[3] * e, g[4] * e};
    double turned = l->reduced[2] + h[2] * m * velocity; /* F' */
    if (c->exact_rotation != 0) {
        double k = cos(w * TICK), q = sin(w * TICK), a = l->harmonic[0], b = l->full[3];
        rate[1] += ((k - 1) * a + q / w * turned) / TICK;
        rate[2] += ((k - 1) * turned - q * w * a) / TICK;
        full[3] += ((k - 1) * b + q / w * l->full[4]) / TICK;
        full[4] += ((k - 1) * l->full[4] - q * w * b) / TICK;
    } else {
        rate[1] += turned;
        rate[2] -= w * w * l->harmonic[0];
        full[3] += l->full[4];
        full[4] -= w * w * l->full[3];
    }
    for (int k = 0; k < 3; k++) l->reduced[k] += TICK * rate[k];
    for (int k = 0; k < 5; k++) l->full[k] += TICK * full[k];
}

/* share of the way that the reference has gone from where the body lay to the set point */
static double lifted(const amb1_control *c, amb1_law_state *l) {
    if (l->mode == LEVITATE) return 1;
    l->lift_clock = least(l->lift_clock + TICK, c->lift_time_s);
    double t = l->lift_clock / c->lift_time_s, smooth = t * t * (3 - 2 * t);
    return l->mode == LIFT ? smooth : 1 - smooth;
}

/* where the body hangs free the observers begin: they know nothing of the ring's force */
static void begin(amb1_law_state *l, int is_free, double y) {
    if (is_free && !l->was_free) {
        memset(l->reduced, 0, sizeof l->reduced);
        memset(l->full, 0, sizeof l->full);
        l->full[0] = y;
    }
    if (l->fresh && l->mode == LIFT) l->rest = y;
    l->was_free = is_free;
    l->fresh = 0;
}

/* the velocity that a telemetry calls `velocity` */
double amb1_told(const amb1_control *c, const amb1_law_state *l) {
    return l->estimate[(int)clip(c->watched < 0 ? c->estimator : c->watched, DIFFERENCE, FULL)];
}

/* what the watched estimator makes of positions, from its start */
void amb1_watch(const amb1_params *p, const amb1_control *c, const amb1_table *table, const double *y, int64_t count, double *v) {
    amb1_law_state l;
    memset(&l, 0, sizeof l);
    for (int64_t k = 0; k < count; k++) {
        amb1_estimate(p, c, table, &l, y[k]);
        v[k] = amb1_told(c, &l);
    }
}

void amb1_law(const amb1_params *p, const amb1_control *c, const amb1_table *table, amb1_law_state *l, double y, double *coil) {
    double h[3], g[5];
    amb1_estimate(p, c, table, l, y);
    coil[0] = coil[1] = 0;
    l->injected = 0;
    int moved = l->lift_clock >= c->lift_time_s, held = l->mode >= LIFT && !(l->mode == LAND && moved);
    int is_free = l->mode == LEVITATE || (l->mode == LIFT && moved);
    begin(l, is_free, y);
    if (!held) return;
    amb1_gains(c, h, g);
    int way = l->mode == LEVITATE ? (int)clip(c->estimator, DIFFERENCE, FULL) : DIFFERENCE, full = way == FULL;
    told(c, l, l->estimate[way], h);
    double velocity = l->estimate[way], m = c->model_mass, ref = l->rest + lifted(c, l) * (c->ref - l->rest);
    double force = m * (-c->kv * velocity - c->kp * (y - ref));
    if (is_free && (c->compensate != 0 || l->mode == LIFT)) force -= l->load[full] + l->harmonic[full];
    const core_injection tone = {c->inject_axis, c->inject_amplitude, c->inject_hz, c->inject_lines, c->inject_step};
    l->injected = core_injected(&tone, &l->tones, TICK);
    l->control = clip(amb1_ccs(force, c->model_beta, c->model_gap, y, c->bias) + l->injected, -c->bias, c->bias);
    coil[0] = least(c->bias + l->control, c->current_limit);
    coil[1] = least(c->bias - l->control, c->current_limit);
    if (is_free) observe(c, l, y, amb1_force(c->model_beta, c->model_gap, y, coil[0], coil[1]), velocity, h, g);
}

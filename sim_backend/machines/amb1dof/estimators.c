/* Velocity from positions: filtered difference, algebraic derivative with one filter (4.23) and with two that overlap (4.17). The
 * filters are (4.13)-(4.14) by explicit Euler, as a firmware has them; or FIR weights that integrate exactly. */
#include <math.h>
#include <string.h>
#include "amb1dof.h"
#include "numbers.h"

static double factorial(int n) { return n < 2 ? 1 : n * factorial(n - 1); }

/* a_1p of (4.15) with the sign (-1)^(n - p): K!^2/(p!^2 (K - p)!), and of the last one K (K - 1), which without it is K (K + 1) */
static double weight(int degree, int p) {
    double top = factorial(degree) / factorial(p);
    return top * top / factorial(degree - p);
}

static void weigh(amb1_law_state *l, int degree) {
    if (l->degree == degree) return;
    for (int p = 0; p < degree - 1; p++) l->weight[p] = weight(degree, p);
    l->degree = degree;
}

/* one sample of one filter; the derivative, or `held` in the sample of the reset */
static double filtered(const amb1_params *p, const amb1_law_state *l, int rule, amb1_filter *f, double y, double held) {
    int degree = l->degree;
    double step = TICK * p->sample_factor, t = f->elapsed * step, out = held, sign = p->literal_sign != 0 ? -1 : 1;
    double power[10] = {1}; /* of -t */
    for (int q = 1; q <= degree; q++) power[q] = power[q - 1] * -t;
    if (f->elapsed == 0) {
        memset(f->eta, 0, sizeof f->eta);
        f->first = y;
    }
    if (rule == FIRST_OFF) y -= f->first;
    double last = p->literal_weights != 0 ? degree * (degree + 1.0) : degree * (degree - 1.0);
    if (f->elapsed > 0) out = -(f->eta[0] + sign * last * power[degree - 1] * y) / power[degree];
    for (int j = 0; j < degree - 1; j++) { /* upwards, so that each takes the next one as it was */
        int q = degree - 2 - j;
        f->eta[j] += step * ((j < degree - 2 ? f->eta[j + 1] : 0) + l->weight[q] * power[q] * y);
    }
    f->elapsed++;
    return out;
}

static double weighted(const amb1_table *table, const amb1_law_state *l, int64_t n) {
    const double *row = table->weights + (n - table->first) * (table->last + 1);
    double sum = 0;
    for (int64_t k = table->last - n; k <= table->last; k++) sum += row[k] * l->past[(l->clock - table->last + k) & (PAST - 1)];
    return sum;
}

static void alone(const amb1_params *p, const amb1_control *c, const amb1_table *table, amb1_law_state *l, double y) {
    int64_t spacing = llround(c->single_window_s / TICK), reset = llround(c->single_reset_s / TICK);
    amb1_filter *f = l->filter + 2;
    if (f->elapsed >= reset) f->elapsed = 0;
    int64_t n = f->elapsed;
    double found = filtered(p, l, (int)c->rule, f, y, l->held);
    if (c->rule == EXACT && n >= spacing && n <= table->last && n >= table->first && l->warm >= n) found = weighted(table, l, n);
    if (n >= spacing) l->held = found; /* through the reset it stays as it was */
    l->estimate[SINGLE] = l->held;
}

static void overlapping(const amb1_params *p, const amb1_control *c, const amb1_table *table, amb1_law_state *l, double y) {
    int64_t spacing = llround(c->window_s / TICK), n[2];
    double found[2];
    for (int k = 0; k < 2; k++) {
        n[k] = (l->clock + k * spacing) % (2 * spacing);
        if (n[k] == 0 || n[k] != l->filter[k].elapsed) l->filter[k].elapsed = 0;
        if (n[k] != l->filter[k].elapsed) { /* begins at its own next reset */
            found[k] = 0;
            continue;
        }
        found[k] = filtered(p, l, (int)c->rule, l->filter + k, y, 0);
        if (c->rule == EXACT && n[k] >= spacing) found[k] = l->warm >= n[k] ? weighted(table, l, n[k]) : 0;
    }
    int older = n[1] < n[0] ? 0 : 1;
    l->estimate[OVERLAPPING] = found[p->swapped != 0 ? 1 - older : older];
}

void amb1_estimate(const amb1_params *p, const amb1_control *c, const amb1_table *table, amb1_law_state *l, double y) {
    double keep = 1 / (1 + TWO_PI * c->filter_hz * TICK);
    weigh(l, (int)clip(c->degree, 3, 9));
    l->past[l->clock & (PAST - 1)] = y;
    if (!l->warm) l->previous = y;
    l->filtered = keep * l->filtered + (1 - keep) * (y - l->previous) / TICK;
    l->previous = y;
    l->estimate[DIFFERENCE] = l->filtered;
    alone(p, c, table + 1, l, y);
    overlapping(p, c, table, l, y);
    if (p->late != 0) {
        double now[4];
        memcpy(now, l->estimate, sizeof now);
        for (int k = SINGLE; k <= OVERLAPPING; k++) l->estimate[k] = l->before[k];
        memcpy(l->before, now, sizeof now);
    }
    l->clock++;
    if (l->warm < PAST) l->warm++;
}

/* Force and torque shared out over two phases, R (17) and (18) with index n in stator II's torque gradient and q for i^2/2:
 *   F = g_a q_a + g_b q_b,  T = t_a q_a + t_b q_b,   q_a = (T g_b - F t_b)/D,  q_b = (F t_a - T g_a)/D,  D = t_a g_b - g_a t_b,
 * g along and t around. A phase only attracts: a pair serves a demand if both q >= 0. Among pairs that do, the one with the least
 * q_a + q_b is taken: with any two of the six allowed that is the least over all six phases at once, for the optimum of a linear
 * programme with two equations has two phases that are not zero. Rule 1 allows one phase of each stator, rule 2 looks the pair up
 * in R's Table 2. `printed_index` takes the torque gradient of stator II's phase m, as R prints. */
#include <math.h>
#include "rlsrm.h"
#include "numbers.h"

#define DEMANDS 2
typedef struct {
    const rlsrm_control *c;
    const double *along, *around;
    int only[2]; /* a pair of Table 2; -1: all that the rule allows */
} choice;

typedef struct {
    int a, b;
    double q[2], cost;
} shares;

/* rows of ten degrees: phases of stators I and II for a positive torque, then for a negative one. At 0 <= x, and below */
static const char *const TABLE[2][9] = {{"CABC", "CAAC", "BCAC", "BCAB", "BCCB", "ABCB", "ABCA", "ABBA", "CABA"},
                                        {"ACCB", "ACCA", "CBCA", "CBBA", "CBCB", "BACB", "BAAC", "BAAB", "ACAB"}};

static void look_up(const rlsrm_control *c, const double *q, const double *asked, int *pair) {
    double turn = q[ANGLE] / (PI / 2), part = 9 * (turn - floor(turn));
    int row = part < 9 ? (int)part : 8, below = (c->by_force != 0 ? asked[X] : q[X]) < 0, back = asked[ANGLE] < 0 ? 2 : 0;
    const char *cell = TABLE[below][row];
    if (c->corrected != 0 && below && back && (row == 4 || row == 5)) cell = row == 4 ? "CBBC" : "BABC";
    int first = cell[back] - 'A', second = cell[back + 1] - 'A';
    pair[0] = c->turned != 0 ? second : first;
    pair[1] = 3 + (c->turned != 0 ? first : second);
}

/* q of a pair for each of `count` demands (x, angle); 0 where the pair is all but singular */
static int solve(const choice *w, int a, int b, const double *demand, int count, double (*q)[2]) {
    const double *g = w->along, *t = w->around;
    double tb = w->c->printed_index != 0 && a < 3 && b > 2 ? t[3 + a] : t[b];
    double first = t[a] * g[b], second = g[a] * tb, d = first - second;
    if (fabs(d) <= 1e-3 * (fabs(first) + fabs(second))) return 0;
    for (int k = 0; k < count; k++) {
        double f = demand[2 * k + X], torque = demand[2 * k + ANGLE];
        q[k][0] = (torque * g[b] - f * tb) / d;
        q[k][1] = (f * t[a] - torque * g[a]) / d;
    }
    return 1;
}

static int allowed(const choice *w, int a, int b) {
    if (w->only[0] >= 0) return a == w->only[0] && b == w->only[1];
    return w->c->rule == 0 || (a < 3 && b > 2);
}

static int serves(const choice *w, int a, int b, const double *demand, shares *s) {
    double q[1][2];
    if (!allowed(w, a, b) || !solve(w, a, b, demand, 1, q)) return 0;
    double slack = -1e-9 * (fabs(q[0][0]) + fabs(q[0][1]));
    if (w->c->clipped == 0 && (q[0][0] < slack || q[0][1] < slack)) return 0;
    *s = (shares){a, b, {most(q[0][0], 0), most(q[0][1], 0)}, 0};
    s->cost = s->q[0] + s->q[1];
    return 1;
}

static int cheapest(const choice *w, const double *demand, const int32_t *former, shares *best) {
    shares s;
    best->cost = INFINITY;
    for (int a = 0; a < PHASES; a++)
        for (int b = a + 1; b < PHASES; b++)
            if (serves(w, a, b, demand, &s) && s.cost < best->cost) *best = s;
    if (best->cost == INFINITY) return 0;
    if (former[0] >= 0 && serves(w, former[0], former[1], demand, &s) && s.cost <= best->cost * (1 + w->c->hysteresis)) *best = s;
    return 1;
}

/* no pair: the force by one phase of the stator that pulls this way, the one whose torque comes nearest */
static int force_alone(const choice *w, const double *demand, shares *best) {
    double off = INFINITY;
    for (int k = 0; k < PHASES; k++) {
        if (w->along[k] * demand[X] <= 0) continue;
        double q = demand[X] / w->along[k], wrong = fabs(demand[ANGLE] - w->around[k] * q);
        if (wrong < off) {
            off = wrong;
            *best = (shares){k, (k + 3) % PHASES, {q, 0}, q};
        }
    }
    return off < INFINITY;
}

/* one axis whole and the largest share s of the other within the current's limit: q is linear in s, so each pair serves an
 * interval of s, and the largest end of all wins */
static int one_whole(const choice *w, int whole, const double *asked, double top, shares *best) {
    double demand[4] = {0}, share = -1, q[2][2];
    demand[whole] = asked[whole];
    demand[2 + 1 - whole] = asked[1 - whole];
    for (int a = 0; a < PHASES; a++)
        for (int b = a + 1; b < PHASES; b++) {
            if (!allowed(w, a, b) || !solve(w, a, b, demand, DEMANDS, q)) continue;
            double low = 0, high = 1;
            for (int n = 0; n < 2; n++) {
                double at = q[0][n], per = q[1][n];
                if (per == 0) {
                    if (at < 0 || at > top) high = -1;
                    continue;
                }
                double none = -at / per, full = (top - at) / per;
                low = most(low, least(none, full));
                high = least(high, most(none, full));
            }
            if (high < low || high <= share) continue;
            share = high;
            *best = (shares){a, b, {most(q[0][0] + high * q[1][0], 0), most(q[0][1] + high * q[1][1], 0)}, 0};
        }
    return share >= 0;
}

static void within_limit(const choice *w, const double *asked, double top, shares *s) {
    if (w->c->priority != 0 && w->only[0] < 0 && one_whole(w, w->c->priority == 1 ? X : ANGLE, asked, top, s)) return;
    double by = top / most(s->q[0], s->q[1]); /* both axes by one factor: the direction is kept, and so is the decoupling */
    s->q[0] *= by;
    s->q[1] *= by;
}

static double squared(double i, double s) { return i * i / (sqrt(1 + i * i / (s * s)) + 1); }

static double current_of(double q, double s) {
    double z = q / (s * s);
    return s * sqrt(z * (z + 2));
}

static int shared_out(const choice *w, const double *asked, int32_t *pair, double *current, double *given) {
    shares s = {0};
    int flags = 0;
    double saturation = w->c->map.saturation, top = squared(w->c->current_max, saturation);
    for (int k = 0; k < PHASES; k++) current[k] = 0;
    given[X] = given[ANGLE] = 0;
    if (!cheapest(w, asked, pair, &s)) {
        flags |= NO_PAIR;
        if (!force_alone(w, asked, &s)) return flags;
    }
    if (most(s.q[0], s.q[1]) > top) {
        flags |= LIMITED;
        within_limit(w, asked, top, &s);
    }
    pair[0] = s.a;
    pair[1] = s.b;
    current[s.a] = current_of(s.q[0], saturation);
    current[s.b] = current_of(s.q[1], saturation);
    given[X] = w->along[s.a] * s.q[0] + w->along[s.b] * s.q[1];
    given[ANGLE] = w->around[s.a] * s.q[0] + w->around[s.b] * s.q[1];
    return flags;
}

/* by the slopes of the controller's map where it reads the mover, q: references of the six currents, and what they give by that
 * map. The pair in force stays while it costs little more than the best. */
int32_t rlsrm_distribute(const rlsrm_control *c, const double *q, const double *along, const double *around, const double *asked,
                         int32_t *pair, double *current, double *given) {
    choice w = {c, along, around, {-1, -1}};
    if (c->rule == 2) look_up(c, q, asked, w.only);
    return shared_out(&w, asked, pair, current, given);
}

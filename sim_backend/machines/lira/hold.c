/* A hold: the bearings' references stay for some ms at their slow means, with a push on top, and the mover leaves its place as the
 * magnets pull it. At 0.3 um of noise a reference at any one instant is up to an ampere off its mean, which would throw the mover
 * out; so it is the mean that is held. The loops catch it when the time is over, or sooner when a reading leaves a bound. */
#include <math.h>
#include "winding.h"

static const int radial[4] = {2, 3, 6, 7}; /* of the ten references: d and q of both rotary actuators' bearing systems */

/* 0: done; 1: not in this state. Across: 0 x, 1 y; no seconds: it ends at once */
int32_t lira_hold(const lira_control *c, lira_state *st, int32_t across, double amperes, double seconds) {
    if (st->mode != LIRA_LEVITATED) return 1;
    for (int k = 0; k < 4; k++) {
        int pushed = k % 2 == across && (int)c->hold_planes >> k / 2 & 1;
        st->frozen[k] = st->mean[k] + (pushed ? amperes : 0);
    }
    st->held = (int32_t)lround(least(seconds, c->hold_most_s) / STEP_S) + (seconds > 0);
    st->hold_ended = 0;
    return 0;
}

/* Of a plane and axis: whether its reading has left the bound, or so much of its limit would be needed to catch it there that there
 * is little to spare. From rest it takes F = F_0 - K x to stand at x; on its way out x'/lambda nears x, and it takes F_0 - 2 K x. */
static int leaves(const lira_control *c, const lira_state *st, int k) {
    int y = k % 2, j = (y ? Y1 : X1) + k / 2;
    double rest = c->model_bearing * st->mean[k] - (y ? c->model_mass / 2 * c->gravity : 0);
    double needed = rest - 2 * c->model_pull * (st->read[j] - st->ref[j]);
    return fabs(st->read[j]) > c->hold_bound_m || fabs(needed) > c->hold_share * c->sat_b;
}

/* at every reading of the positions, before the loops */
void lira_hold_on(const lira_control *c, lira_state *st) {
    if (!st->held) return;
    int out = 0;
    for (int k = 0; k < 4; k++) out |= leaves(c, st, k);
    st->hold_ended = out;
    st->held = out || st->mode != LIRA_LEVITATED ? 0 : st->held - 1;
}

/* after the loops: references as they are frozen, or their means carried on; the force that the observers and the catch go on from */
void lira_frozen(const lira_control *c, lira_state *st, double weight) {
    double share = c->hold_mean_s > STEP_S ? STEP_S / c->hold_mean_s : 1;
    for (int k = 0; k < 4; k++) {
        double *wanted = &st->wanted[radial[k]];
        if (!st->held) {
            st->mean[k] += st->bearings_on ? share * (*wanted - st->mean[k]) : -st->mean[k];
            continue;
        }
        *wanted = st->frozen[k];
        st->force[k % 2 ? Y1 + k / 2 : X1 + k / 2] = c->model_bearing * st->frozen[k] - (k % 2 ? weight : 0);
    }
}

/* The fast part, 280 kHz: five dq systems, each a cascade of coil current PI, capacitor voltage PI, inductor current P, L (10)-(13)
 * with their cross terms as corrected: (12) has + in q, (11) the coupling of u_s. A voltage acts from the next tick on. */
#include <math.h>
#include <string.h>
#include "winding.h"

/* Readings of the half-bridges, by terminal: inductor currents are late by `late` s on a slope of duty U_DC/L_f, which is another
 * error in each of them; voltages have the carrier's ripple, alike in all and alternating from edge to edge. */
static void read(const lira_params *p, lira_state *st) {
    double normal[3 * BRIDGES], slope = p->late, edge = st->tick & 1 ? -p->ripple : p->ripple;
    double per_i = p->bridge_lsb > 0 ? 1 / p->bridge_lsb : 0, per_u = p->voltage_lsb > 0 ? 1 / p->voltage_lsb : 0,
           per_c = p->coil_lsb > 0 ? 1 / p->coil_lsb : 0;
    if (p->bridge_noise > 0 || p->voltage_noise > 0 || p->coil_noise > 0) core_draws(&st->noise, normal, 3 * BRIDGES);
    else memset(normal, 0, sizeof normal);
    for (int k = 0; k < BRIDGES; k++) {
        double late = slope * (0.5 * p->supply + st->sent[k]) / p->filter_l[k];
        double i = p->bridge_gain[k] * (st->bridge[k] - late) + p->bridge_offset[k] + p->bridge_noise * normal[k];
        double v = p->voltage_gain[k] * (st->u[k] + edge) + p->voltage_noise * normal[BRIDGES + k];
        double s = p->coil_gain[k] * st->coil[k] + p->coil_offset[k] + p->coil_noise * normal[2 * BRIDGES + k];
        st->bridge_read[k] = quantise(i, p->bridge_lsb, per_i);
        st->u_read[k] = quantise(v, p->voltage_lsb, per_u);
        st->coil_read[k] = quantise(s, p->coil_lsb, per_c);
    }
}

typedef struct {
    double kp, ki, l, omega, psi;
} winding;

static INLINE winding of_system(const lira_control *c, const lira_state *st, int k) {
    if (k == 4) {
        double omega = TWO_PI / c->model_pitch * st->seen_rate[Z];
        return (winding){c->kp_sl, c->ki_sl, c->model_l_lin, omega, c->psi_lin};
    }
    double omega = POLE_PAIRS * st->seen_rate[ANGLE];
    return (winding){c->kp_s, c->ki_s, c->model_l_rot, omega, k == 0 || k == 2 ? c->psi_rot : 0};
}

/* one axis of one system; j: its number among the ten */
static INLINE double cascade(const lira_control *c, lira_state *st, const winding *w, int j, double half) {
    int o = j ^ 1;
    double way = j & 1 ? w->omega : -w->omega, of_flux = j & 1 ? w->omega * w->psi : 0;
    double e = st->wanted[j] - st->coil_dq[j], u = w->kp * e + st->stator[j] + way * w->l * st->coil_dq[o] + of_flux;
    double u_ref = clip(u, -half, half);
    if (u == u_ref) st->stator[j] += w->ki * LIRA_TICK * e;
    double lack = u_ref - st->u_dq[j], i = c->kp_v * lack + st->capacitor[j] + way * c->model_c * st->u_dq[o];
    double i_ref = clip(i, -c->current_max, c->current_max);
    if (i == i_ref && fabs(st->sent_dq[j]) < half) st->capacitor[j] += c->ki_v * LIRA_TICK * lack;
    double send = c->kp_i * (i_ref - st->bridge_dq[j]) + way * c->model_l_f * st->bridge_dq[o] + st->u_dq[j];
    st->u_ref[j] = u_ref;
    st->bridge_ref[j] = i_ref;
    st->sent_dq[j] = clip(send, -half, half);
    return send;
}

void lira_currents(const lira_params *p, const lira_control *c, lira_state *st) {
    double send[10], half = p->supply / 2;
    lira_turn ra[2] = {{st->cos_ra[0], st->sin_ra[0]}, {st->cos_ra[1], st->sin_ra[1]}}, la = {st->cos_la, st->sin_la};
    read(p, st);
    split_all(st->bridge_read, ra, la, st->bridge_dq);
    split_all(st->u_read, ra, la, st->u_dq);
    split_all(st->coil_read, ra, la, st->coil_dq);
    for (int k = 0; k < SYSTEMS; k++) {
        winding w = of_system(c, st, k);
        send[2 * k] = cascade(c, st, &w, 2 * k, half);
        send[2 * k + 1] = cascade(c, st, &w, 2 * k + 1, half);
    }
    join_all(send, ra, la, st->next);
    for (int k = 0; k < BRIDGES; k++) st->next[k] = st->currents_on ? clip(st->next[k], -half, half) : 0;
}

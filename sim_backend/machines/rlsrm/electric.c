/* Six windings and their amplifiers. R (6): d(psi)/dt = u - R i, solved in flux by the trapezoidal rule,
 *   psi(i1, place 1) + h/2 R i1 = psi(i0, place 0) + h (u - R i0/2),
 * where what moves and turns is in psi at both places: no back-emf has to be written, and energy closes. Newton finds i1.
 * An amplifier regulates its current every tick: u = R i* + kp (i* - i) + integral, limited; it drives no current backwards and
 * its bridge blocks at zero. */
#include <math.h>
#include "rlsrm.h"
#include "numbers.h"

void rlsrm_amplifiers(const rlsrm_params *p, const rlsrm_control *c, rlsrm_state *st, double *u) {
    for (int k = 0; k < PHASES; k++) {
        int winding = (int)p->wired[k];
        double wanted = st->on ? st->wanted[k] : 0, i = st->i[winding];
        if (st->pulse_left > 0 && st->pulse_phase == k) wanted = c->current_max;
        if (wanted == 0 && i == 0) {
            st->summed[k] = u[winding] = 0;
            continue;
        }
        double read = p->current_gain[k] * i + (wanted > 0 ? p->current_offset[k] - c->current_zero[k] : 0), off = wanted - read;
        double most_V = p->supply * p->share[k], ask = c->resistance * wanted + c->kp_i * off + st->summed[k];
        u[winding] = clip(ask, -most_V, most_V);
        if (u[winding] == ask)
            st->summed[k] += c->ki_i * off * RLSRM_TICK;
        else
            st->summed[k] *= 0.9;
    }
}

static INLINE double flux_of(double i, double per_s2) { return i / sqrt(1 + i * i * per_s2); }

/* currents after a time with voltages u held, the mover having gone from where G was `before` to where it is now; u becomes what
 * was given where a bridge blocks */
void rlsrm_currents(const rlsrm_params *p, rlsrm_state *st, const double *before, double *u, double seconds) {
    double per_s2 = 1 / (p->map.saturation * p->map.saturation);
    for (int k = 0; k < PHASES; k++) {
        double i0 = st->i[k], i = i0;
        if (i0 == 0 && u[k] == 0) continue;
        double half_r = 0.5 * seconds * p->resistance[k] * (1 + p->copper * (st->warm[k] - 20)), linear = p->map.leakage + half_r;
        double held = p->map.leakage * i0 + before[k] * flux_of(i0, per_s2) - half_r * i0, right = held + seconds * u[k];
        if (right <= 0) {
            st->i[k] = 0;
            u[k] = -held / seconds;
            continue;
        }
        for (int n = 0; n < 20; n++) {
            double z = 1 + i * i * per_s2, per_root = 1 / sqrt(z), g = st->g[k] * per_root;
            double step = ((linear + g) * i - right) / (linear + g * per_root * per_root);
            i -= step;
            if (fabs(step) < 1e-7 * (1 + fabs(i))) break; /* the error left is of the order of its square */
        }
        st->i[k] = i;
    }
}

/* force and torque by the slopes of the co-energy, of all phases */
void rlsrm_forces(const rlsrm_params *p, rlsrm_state *st) {
    double per_s2 = 1 / (p->map.saturation * p->map.saturation), force = 0, torque = 0;
    for (int k = 0; k < PHASES; k++) {
        if (st->i[k] == 0) continue;
        double square = st->i[k] * st->i[k], q = square / (sqrt(1 + square * per_s2) + 1);
        force += st->along[k] * q;
        torque += st->around[k] * q;
    }
    st->force[X] = force;
    st->force[ANGLE] = torque;
}

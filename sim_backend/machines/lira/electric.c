/* Half-bridges, their filters and the coils, L (5)-(8) with the damper that (6) leaves out: averaged over a carrier period, the
 * middle of the DC link as zero. Coils {1,3,5}, {2,4,6} of each rotary actuator and those of the linear one end in isolated stars:
 *   L_f i_f' = u_sw - r_f i_f - u_s,   C_f u_s' = i_f - i_s - (u_s - u_d)/R_d,   C_d u_d' = (u_s - u_d)/R_d,
 *   L i_s' = u_s - v - R i_s - e,      v = sum((u_s - R i_s - e)/L)/sum(1/L) over a star.
 * A star is linear with inputs that are constant over a tick: its step is a matrix, made once by scaling and squaring. */
#include <math.h>
#include <string.h>
#include "winding.h"

#define N 18
static const int STAR[SYSTEMS][3] = {{0, 2, 4}, {1, 3, 5}, {6, 8, 10}, {7, 9, 11}, {12, 13, 14}};

static void multiply(const double *a, const double *b, double *out, double by) {
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            double sum = 0;
            for (int k = 0; k < N; k++) sum += a[i * N + k] * b[k * N + j];
            out[i * N + j] = sum * by;
        }
}

/* exp(a), Taylor to the sixteenth power of a over 16 */
static void exponential(const double *a, double *out) {
    double scaled[N * N], term[N * N], other[N * N];
    for (int i = 0; i < N * N; i++) {
        scaled[i] = a[i] / 16;
        out[i] = term[i] = i % (N + 1) == 0;
    }
    for (int order = 1; order <= 16; order++) {
        multiply(term, scaled, other, 1.0 / order);
        memcpy(term, other, sizeof term);
        for (int i = 0; i < N * N; i++) out[i] += term[i];
    }
    for (int k = 0; k < 4; k++) {
        multiply(out, out, other, 1);
        memcpy(out, other, sizeof other);
    }
}

/* rates of star g: states 3 k + a (i_f, u_s, u_d, i_s of member a), inputs 12 + a (u_sw) and 15 + a (emf) */
static void rates(const lira_params *p, const int32_t *member, double *out) {
    double inverse = 0, l[3], r[3];
    memset(out, 0, N * N * sizeof *out);
    for (int a = 0; a < 3; a++) {
        int coil = (int)p->terminal[member[a]];
        l[a] = p->coil_l[coil];
        r[a] = p->coil_r[coil];
        inverse += 1 / l[a];
    }
    for (int a = 0; a < 3; a++) {
        int k = member[a];
        double damp = 1 / (p->damper_r[k] * p->filter_c[k]), *f = out + a * N, *u = out + (3 + a) * N, *d = out + (6 + a) * N;
        f[a] = -p->filter_r / p->filter_l[k];
        f[3 + a] = -1 / p->filter_l[k];
        f[12 + a] = 1 / p->filter_l[k];
        u[a] = 1 / p->filter_c[k];
        u[3 + a] = -damp;
        u[6 + a] = damp;
        u[9 + a] = -1 / p->filter_c[k];
        d[3 + a] = 1 / (p->damper_r[k] * p->damper_c[k]);
        d[6 + a] = -d[3 + a];
        for (int b = 0; b < 3; b++) {
            double share = ((a == b) - 1 / (l[b] * inverse)) / l[a], *i = out + (9 + a) * N;
            i[3 + b] = share;
            i[9 + b] = -share * r[b];
            i[15 + b] = -share;
        }
    }
}

/* which half-bridge drives each coil of a star, and the star's step */
void lira_stars(const lira_params *p, lira_state *st) {
    double a[N * N], step[N * N];
    for (int g = 0; g < SYSTEMS; g++) {
        for (int m = 0; m < 3; m++)
            for (int k = 0; k < BRIDGES; k++)
                if ((int)p->terminal[k] == STAR[g][m]) st->member[g][m] = k;
        rates(p, st->member[g], a);
        for (int i = 0; i < N * N; i++) a[i] *= LIRA_TICK;
        exponential(a, step);
        for (int j = 0; j < N; j++)
            for (int i = 0; i < 12; i++) st->star[g][j * 12 + i] = step[i * N + j];
    }
}

/* emf of every coil by one function of flux, so that energy is conserved:
 * lambda_k = Psi cos(phi + 120 k) + Psi_b (x cos(phi + 60 k) - y sin(phi + 60 k)), Psi = K_R/(3 P), Psi_b = K_B/3 */
static void induced(const lira_params *p, const lira_state *st, const lira_place *at, double *e) {
    double turn = POLE_PAIRS * st->v[ANGLE], dq[10];
    for (int a = 0; a < 2; a++) {
        double bearing = p->bearing_constant[a] / 3;
        dq[4 * a] = 0;
        dq[4 * a + 1] = turn * p->torque_constant[a] / (3 * POLE_PAIRS);
        dq[4 * a + 2] = bearing * (at->vx[a] - turn * at->y[a]);
        dq[4 * a + 3] = bearing * (at->vy[a] + turn * at->x[a]);
    }
    dq[8] = 0;
    dq[9] = st->v[Z] * p->force_constant / 1.5; /* (2 pi/tau) z' Psi_l with Psi_l = K_L/(1.5 2 pi/tau) */
    join_all(dq, at->ra, at->la, e);
}

void lira_step_stars(const lira_params *p, lira_state *st, const lira_place *at) {
    double e[BRIDGES];
    induced(p, st, at, e);
    for (int g = 0; g < SYSTEMS; g++) {
        const int32_t *member = st->member[g];
        double in[N], out[12] = {0};
        for (int a = 0; a < 3; a++) {
            int k = member[a];
            in[a] = st->bridge[k];
            in[3 + a] = st->u[k];
            in[6 + a] = st->damper[k];
            in[9 + a] = st->coil[k];
            in[12 + a] = st->sent[k];
            in[15 + a] = p->emf * p->strength[k] * (p->turned[k] != 0 ? -1 : 1) * e[STAR[g][a]];
        }
        for (int j = 0; j < N; j++)
            for (int i = 0; i < 12; i++) out[i] += st->star[g][j * 12 + i] * in[j];
        for (int a = 0; a < 3; a++) {
            int k = member[a];
            st->bridge[k] = out[a];
            st->u[k] = out[3 + a];
            st->damper[k] = out[6 + a];
            st->coil[k] = out[9 + a];
        }
    }
}

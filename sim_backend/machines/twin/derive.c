/* What follows from the parameters once in a run; the right-hand side for tests. */
#include <math.h>
#include <string.h>
#include "twin.h"

static int steps_of(double tick, double most, int least) {
    int n = (int)ceil(tick / most - 1e-9);
    return n > least ? n : least;
}

void twin_derive(const twin_params *p, twin_derived *d) {
    memset(d, 0, sizeof *d);
    d->axes = p->radial + p->axial;
    d->blocks = (p->radial + 3) / 4;
    d->law_blocks = (d->axes + 3) / 4;
    d->probe_blocks = (p->probes + 3) / 4;
    d->per_mass = 1 / p->mass;
    d->per_inertia = 1 / p->inertia;
    d->per_polar = 1 / p->polar_inertia;
    d->per_tick = 1 / p->tick;
    d->per_position_lsb = p->position_lsb > 0 ? 1 / p->position_lsb : 0;
    d->per_current_lsb = p->current_lsb > 0 ? 1 / p->current_lsb : 0;
    for (int k = 0; k < 32; k++) {
        d->per_gain[k] = 1 / p->current_gain[k];
        d->pull[k] = p->inductance[k % 16] * p->amplifier_rate;
    }
    for (int k = 0; k < 64; k++) d->runs_out |= p->runout_c[k] != 0 || p->runout_s[k] != 0;
    d->flexible = p->mode_on[0] != 0 || p->mode_on[1] != 0;
    for (int k = 0; k < 2; k++) {
        double w = TWO_PI * p->mode_hz[k];
        d->square[k] = w * w;
        d->damp[k] = 2 * p->mode_damping[k] * w;
    }
    d->steps[0] = steps_of(p->tick, 1e-4 / p->substeps, 1);
    d->steps[1] = steps_of(p->tick, 2e-5, d->steps[0]);
    d->steps[2] = steps_of(p->tick, 1e-5, d->steps[0]);
    for (int k = 0; k < 3; k++) d->keep[k] = exp(-p->amplifier_rate * p->tick / d->steps[k] / 2);
    d->free_ticks = (int)ceil(5e-3 * d->per_tick);
}

/* For tests: the right-hand side with `torque` N m of drive and Coulomb drag on the shaft. */
void twin_derivative(const twin_params *p, const double *s, const double *coil, const double *load, double torque, double *ds) {
    twin_derived d;
    twin_derive(p, &d);
    twin_unbalance(p, 0, &d);
    turned_to(&d.turned, s[5]);
    d.torque = torque;
    d.near = 1;
    memset(ds, 0, 20 * sizeof *ds);
    twin_rates(p, &d, s, coil, load, ds);
}

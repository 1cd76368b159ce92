/* The controller's own idea of the machine: coordinates, planes, magnetic places and forces. */
#include "amb5dof.h"

/* T (2.17) solved for x, y, z, psi, theta; W (y) and V (z) by bearing */
void amb_coordinates(const amb_control *c, const double *at, double x, double *q) {
    double per_span = 1 / (c->model_l_is + c->model_l_os);
    q[X] = at[AXIAL];
    q[THETA] = (at[YO] - at[YI]) * per_span;
    q[PSI] = (at[ZI] - at[ZO]) * per_span;
    q[Y] = at[YI] + (c->model_l_is + x) * q[THETA];
    q[Z] = at[ZO] + (c->model_l_os - x) * q[PSI];
}

/* T (2.17) at x = 0 */
void amb_planes(const amb_control *c, const double *q, double *at) {
    at[YI] = q[Y] - c->model_l_is * q[THETA];
    at[ZI] = q[Z] + c->model_l_is * q[PSI];
    at[YO] = q[Y] + c->model_l_os * q[THETA];
    at[ZO] = q[Z] - c->model_l_os * q[PSI];
    at[AXIAL] = q[X];
}

static void offsets(const amb_control *c, double *offset) {
    offset[YI] = c->model_offset_yi, offset[ZI] = c->model_offset_zi;
    offset[YO] = c->model_offset_yo, offset[ZO] = c->model_offset_zo;
    offset[AXIAL] = 0;
}

void amb_betas(const amb_control *c, double *beta) {
    beta[YI] = c->model_beta_yi, beta[ZI] = c->model_beta_zi;
    beta[YO] = c->model_beta_yo, beta[ZO] = c->model_beta_zo;
    beta[AXIAL] = c->model_beta_x;
}

/* where the shaft is in the AMBs' planes, from their magnetic centres (T, under (2.4)) */
void amb_magnetic(const amb_control *c, const double *q, double *xi) {
    double in = c->model_l_ia + q[X], out = c->model_l_oa - q[X];
    offsets(c, xi);
    xi[YI] += q[Y] - in * q[THETA];
    xi[ZI] += q[Z] + in * q[PSI];
    xi[YO] += q[Y] + out * q[THETA];
    xi[ZO] += q[Z] - out * q[PSI];
    xi[AXIAL] = q[X];
}

/* the model's forces (2.4) of given coil currents */
void amb_forces(const amb_control *c, const double *q, const double *coil, double *force) {
    double xi[5], beta[5];
    amb_magnetic(c, q, xi);
    amb_betas(c, beta);
    for (int k = 0; k < 4; k++) {
        double near = c->model_gap - xi[k], far = c->model_gap + xi[k], a = coil[2 * k] * far, b = coil[2 * k + 1] * near;
        force[k] = beta[k] * (a - b) * (a + b) / (near * near * far * far);
    }
}

/* A rotor that carries masses: two coils a bearing with force over square of gap, a rigid shaft in vertical equilibrium, runout
 * of the journals by angle, current sensors within their certificates, noise. What changes settles with a lag. */
#include "mischief.h"
#include <math.h>
#include <string.h>

/* rigs/tsbs12.toml: spans, weights, nominal gap; T Table 6.1 */
static const double SPAN = 0.125, HOOK = 0.150, COM_INBOARD = 0.115, SHAFT_KG = 10.2, HANGER_KG = 0.25, GAP = 0.5e-3;
static const double GRAVITY = 9.81175, AIR = 1.11, STEEL = 7950;
static const double LAG = 0.015, NOISE_A = 1.5e-3, NOISE_M = 5e-8, REST_M = -200e-6, TWO_PI = 6.283185307179586;
enum { IN, OUT };

double hung_kg;
static double slope[2], offset[2], runout[2][2][2]; /* N/A; m; bearing, order, amplitude and phase */
static double gain[2][2], zero[2][2];               /* of the sensors of the y coils: bearing, p and n */
static double control[2], step[2];                  /* A; how far it is from where it settles */
static double turned, turns, rate;                  /* rad, over turns */
static int was_up;

void make_rotor(unsigned seed, double k_i, double k_o) {
    for (unsigned k = 0; k < 100 + seed; k++) uniform(0, 1);
    slope[IN] = k_i;
    slope[OUT] = k_o;
    for (int b = IN; b <= OUT; b++) {
        offset[b] = uniform(-20e-6, 20e-6);
        for (int order = 0; order < 2; order++) {
            runout[b][order][0] = order ? uniform(1e-6, 5e-6) : uniform(12e-6, 28e-6);
            runout[b][order][1] = uniform(0, TWO_PI);
        }
        for (int coil = 0; coil < 2; coil++) {
            gain[b][coil] = 1 + uniform(-0.003, 0.003);
            zero[b][coil] = uniform(-0.004, 0.004);
        }
    }
}

/* dF/di at no control current of a bearing of unit constant and bias `bias`, with the shaft `e` off its magnetic centre */
static double unit_slope(double bias, double e) {
    return 2 * bias * (1 / ((GAP - e) * (GAP - e)) + 1 / ((GAP + e) * (GAP + e)));
}

static double eccentricity(int b, double theta) {
    double e = offset[b];
    for (int order = 0; order < 2; order++) e += runout[b][order][0] * cos((order + 1) * theta + runout[b][order][1]);
    return e;
}

/* of F = C ((I + i)^2 / (g - e)^2 - (I - i)^2 / (g + e)^2): the constant that gives the mean slope over a turn at a bias of 3 A */
static double constant(int b) {
    double sum = 0;
    for (int k = 0; k < 360; k++) sum += unit_slope(3.0, eccentricity(b, k * TWO_PI / 360)) / 360;
    return slope[b] / sum;
}

/* the control current that gives a force, A; by Newton from the tangent */
static double current(int b, double force, double bias) {
    double e = eccentricity(b, turned), near = (GAP - e) * (GAP - e), far = (GAP + e) * (GAP + e), c = constant(b), i = 0;
    for (int k = 0; k < 8; k++) {
        double f = c * ((bias + i) * (bias + i) / near - (bias - i) * (bias - i) / far);
        i -= (f - force) / (2 * c * ((bias + i) / near + (bias - i) / far));
    }
    return i;
}

/* weight in air of a conventional mass, OIML D 28 */
static double weight(double kg) { return GRAVITY * kg * (1 - 1.2 / 8000) / (1 - 1.2 / STEEL) * (1 - AIR / STEEL); }

static void turn(int up) {
    double goal = *parameter(30) + turns * TWO_PI, most = *parameter(31) * 1e-3;
    if (up && !was_up) turns = round((turned - *parameter(30)) / TWO_PI), goal = *parameter(30) + turns * TWO_PI;
    was_up = up;
    rate = speed;
    if (on("stuckangle")) return;
    if (state == LEVITATED && speed == 0) {
        double way = goal - turned;
        way = way > most ? most : way < -most ? -most : way;
        rate = way * 1e3;
    }
    turned += rate * 1e-3;
    angle = remainder(turned, TWO_PI);
}

void rotor_millisecond(void) {
    int up = state != OFF && state != READY && state != FAULT;
    double shaft = SHAFT_KG * GRAVITY, load = weight(HANGER_KG + hung_kg), force[2];
    turn(up);
    force[OUT] = (shaft * COM_INBOARD + load * (SPAN + HOOK)) / SPAN;
    force[IN] = shaft + load - force[OUT];
    for (int b = IN; b <= OUT; b++) {
        step[b] = up ? current(b, force[b], *parameter(b == IN ? 1 : 2)) - control[b] : -control[b];
        control[b] += step[b] * 1e-3 / LAG;
    }
}

static void reading(uint8_t *at, double amperes) { put_scaled(at, amperes + normal(NOISE_A), 0.0005, -32768, 32767); }

void rotor_readings(uint8_t *m) {
    int up = state != OFF && state != READY && state != FAULT;
    for (int b = IN; b <= OUT; b++) {
        double bias = up ? *parameter(b == IN ? 1 : 2) : 0, sag = up ? -5e-6 * step[b] : REST_M;
        put_scaled(m + (b == IN ? 6 : 10), normal(NOISE_M), 2e-8, -32768, 32767);
        put_scaled(m + (b == IN ? 8 : 12), sag + normal(NOISE_M), 2e-8, -32768, 32767);
        for (int coil = 0; coil < 2; coil++) {
            double i = up ? bias + (coil ? -control[b] : control[b]) : 0;
            reading(m + 20 + 8 * b + 2 * coil, bias);
            reading(m + 24 + 8 * b + 2 * coil, gain[b][coil] * i + zero[b][coil]);
        }
    }
    put_scaled(m + 14, normal(NOISE_M), 2e-8, -32768, 32767);
    put_scaled(m + 16, angle, TWO_PI / 65536, -32768, 32767);
    put_scaled(m + 18, rate, 0.005, -32768, 32767);
    reading(m + 36, up ? 2 : 0);
    reading(m + 38, up ? 2 : 0);
    for (int k = 0; k < 4; k++) reading(m + 40 + 2 * k, 0);
    if (!up) put(m + 60, get(m + 60, 2) | 12, 2); /* it lies on both rings */
}

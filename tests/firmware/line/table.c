/* Parameters and channels. */
#include "line.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct parameter parameters[] = { /* low, high, as delivered; then what is in force and what is kept */
    {"kp.b", "N/m", 0, 2000000, 680000, 0, 0},
    {"ki.b", "N/(m s)", 0, 50000000, 10200000, 0, 0},
    {"kd.b", "N s/m", 0, 10000, 2550, 0, 0},
    {"sat.b", "N", 0, 40, 26.2, 0, 0},
    {"l11.b", "1", 0, 1, 0.06, 0, 0},
    {"l22.b", "1", 0, 1, 0.04, 0, 0},
    {"kp.r", "N m/rad", 0, 200, 25, 0, 0},
    {"ki.r", "N m/(rad s)", 0, 2000, 99, 0, 0},
    {"kd.r", "N m s/rad", 0, 5, 0.8, 0, 0},
    {"sat.r", "N m", 0, 1.5, 0.839, 0, 0},
    {"l11.r", "1", 0, 1, 1, 0, 0},
    {"l22.r", "1", 0, 1, 0.005, 0, 0},
    {"kp.z", "N/m", 0, 1000000, 125000, 0, 0},
    {"ki.z", "N/(m s)", 0, 50000000, 5862000, 0, 0},
    {"kd.z", "N s/m", 0, 5000, 1000, 0, 0},
    {"sat.z", "N", 0, 300, 166, 0, 0},
    {"l11.z", "1", 0, 1, 0.02, 0, 0},
    {"l22.z", "1", 0, 1, 0.09, 0, 0},
    {"kp.s", "V/A", 0, 200, 40, 0, 0},
    {"ki.s", "V/(A s)", 0, 1000000, 20000, 0, 0},
    {"kp.sl", "V/A", 0, 2000, 516.7, 0, 0},
    {"ki.sl", "V/(A s)", 0, 1000000, 105000, 0, 0},
    {"kp.v", "A/V", 0, 2, 0.405, 0, 0},
    {"ki.v", "A/(V s)", 0, 100000, 3553, 0, 0},
    {"kp.i", "V/A", 0, 50, 10.23, 0, 0},
    {"imax", "A", 0, 40, 20, 0, 0},
    {"observer", "1", 0, 2, 1, 0, 0},
    {"limit_after_ff", "1", 0, 1, 0, 0, 0},
    {"m", "kg", 0.1, 10, 1.34, 0, 0},
    {"j", "kg m^2", 1e-05, 1, 0.00145, 0, 0},
    {"pull", "N/m", 0, 1000000, 375000, 0, 0},
    {"psi.rot", "Wb", 0, 1, 0.0207, 0, 0},
    {"psi.lin", "Wb", 0, 1, 0.11, 0, 0},
    {"fcogg", "N", 0, 100, 20, 0, 0},
    {"tcogg", "N m", 0, 1, 0.0376, 0, 0},
    {"zero.ra1", "rad", -3.141592654, 3.141592654, 0, 0, 0},
    {"zero.ra2", "rad", -3.141592654, 3.141592654, 0, 0, 0},
    {"zero.la", "rad", -3.141592654, 3.141592654, 0, 0, 0},
    {"gate", "m", 0, 0.0001, 2e-05, 0, 0},
    {"gate.time", "s", 0, 5, 0.25, 0, 0},
    {"z.off", "m", 0, 0.005, 0.0027, 0, 0},
    {"v.land", "m/s", 0, 0.1, 0.01, 0, 0},
};
const int parameter_count = COUNT(parameters);
struct channel channels[CHANNELS];

static void add(int k, const char *name, const char *unit, double scale)
{
    snprintf(channels[k].name, sizeof channels[k].name, "%s", name);
    channels[k].unit = unit;
    channels[k].scale = scale;
}

void table_start(void)
{
    static const char *const dq[CURRENTS] = {"d_R1", "q_R1", "d_B1", "q_B1", "d_R2", "q_R2", "d_B2", "q_B2", "d_L", "q_L"};
    char name[8];
    for (int k = 0; k < 15; k++) {
        snprintf(name, sizeof name, "i_f%d", k + 1);
        add(k, name, "A", 0.0244);
        snprintf(name, sizeof name, "u_s%d", k + 1);
        add(15 + k, name, "V", 0.122);
        snprintf(name, sizeof name, "i_s%d", k + 1);
        add(30 + k, name, "A", 0.0073);
    }
    add(45, "u_dc", "V", 0.122);
    for (int k = 0; k < 4; k++) add(46 + k, axis_names[k], "m", 2.5e-7);
    add(50, "z", "m", 1e-6);
    add(51, "gamma", "rad", 6.283185307179586 / 65536);
    for (int k = 0; k < CURRENTS; k++) {
        snprintf(name, sizeof name, "i_%s", dq[k]);
        add(52 + k, name, "A", 4e-4);
    }
    add(62, "wave", "1", 1.0 / 32768);
    add(63, "held", "1", 1);
    for (int k = 0; k < parameter_count; k++) parameters[k].value = parameters[k].saved = (float)parameters[k].delivered;
}

struct parameter *parameter_named(const char *name)
{
    for (int k = 0; k < parameter_count; k++)
        if (!strcmp(parameters[k].name, name)) return &parameters[k];
    return NULL;
}

int channel_named(const char *name)
{
    char *end = NULL;
    long index = strtol(name, &end, 10);
    if (*name && !*end) return index >= 0 && index < CHANNELS ? (int)index : -1;
    for (int k = 0; k < CHANNELS; k++)
        if (!strcmp(channels[k].name, name)) return k;
    return -1;
}

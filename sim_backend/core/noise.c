/* Counter-based noise: the n-th draw of a stream is a hash of (key, n), so a run is equal for equal seeds everywhere.
 * Hash: the finaliser of SplitMix64 on key + n * odd constant. Normals: ziggurat with 128 layers (Marsaglia and Tsang;
 * constants R and V of Doornik 2005). */
#include <math.h>
#include "core.h"

#define LAYERS 128
static const double R = 3.442619855899, V = 9.91256303526217e-3;
static double edge[LAYERS + 1], ratio[LAYERS];
static int ready = 0;

static void tables(void) {
    double f = exp(-0.5 * R * R);
    edge[0] = V / f;
    edge[1] = R;
    edge[LAYERS] = 0;
    for (int i = 2; i < LAYERS; i++) {
        edge[i] = sqrt(-2 * log(V / edge[i - 1] + f));
        f = exp(-0.5 * edge[i] * edge[i]);
    }
    for (int i = 0; i < LAYERS; i++) ratio[i] = edge[i + 1] / edge[i];
    ready = 1;
}

static uint64_t mix(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

void core_noise_seed(core_noise *n, uint64_t seed, uint64_t stream) {
    if (!ready) tables();
    n->key = mix(mix(seed + 0x9E3779B97F4A7C15u) ^ mix(stream * 0xD1B54A32D192ED03u + 1));
    n->counter = 0;
}

static uint64_t draw(core_noise *n) { return mix(n->key + ++n->counter * 0x9E3779B97F4A7C15u); }
static double uniform(core_noise *n) { return ((double)(draw(n) >> 11) + 0.5) * 0x1p-53; }

/* the whole method, from a first draw on */
static double slow(core_noise *n, uint64_t bits) {
    for (;; bits = draw(n)) {
        int i = bits & (LAYERS - 1);
        double u = 2 * (((double)(bits >> 11) + 0.5) * 0x1p-53) - 1;
        if (fabs(u) < ratio[i]) return u * edge[i];
        if (i == 0) { /* tail beyond R */
            double x, y;
            do {
                x = log(uniform(n)) / R;
                y = log(uniform(n));
            } while (-2 * y < x * x);
            return u < 0 ? x - R : R - x;
        }
        double x = u * edge[i];
        double f0 = exp(-0.5 * (edge[i] * edge[i] - x * x)), f1 = exp(-0.5 * (edge[i + 1] * edge[i + 1] - x * x));
        if (f1 + uniform(n) * (f0 - f1) < 1) return x;
    }
}

/* 98 of 100 draws fall inside their layer */
static inline double one(core_noise *n) {
    uint64_t bits = draw(n);
    int i = bits & (LAYERS - 1);
    double u = 2 * (((double)(int64_t)(bits >> 11) + 0.5) * 0x1p-53) - 1;
    return fabs(u) < ratio[i] ? u * edge[i] : slow(n, bits);
}

double core_normal(core_noise *n) { return one(n); }

void core_draws(core_noise *n, double *out, int count) {
    for (int k = 0; k < count; k++) out[k] = one(n);
}

void core_normals(uint64_t seed, uint64_t stream, double *out, int64_t count) {
    core_noise n;
    core_noise_seed(&n, seed, stream);
    for (int64_t k = 0; k < count; k++) out[k] = core_normal(&n);
}

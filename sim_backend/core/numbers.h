/* Small functions of numbers. All of them are put in place, so that loops over axes and coils become vector operations. */
#ifndef NUMBERS_H
#define NUMBERS_H

#define TWO_PI 6.283185307179586
#define PI 3.141592653589793
#define INLINE inline __attribute__((always_inline))

static INLINE double least(double a, double b) { return a < b ? a : b; }
static INLINE double most(double a, double b) { return a > b ? a : b; }
static INLINE double clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

#define WHOLE 6755399441055744.0
/* Nearest multiple of lsb (0: none): at the size of WHOLE a double holds no fractions, so adding it rounds. Without a branch,
 * for the sign of what is nothing but noise cannot be predicted. `per_lsb` is 1/lsb. */
static INLINE double quantise(double x, double lsb, double per_lsb) {
    return lsb > 0 ? lsb * (x * per_lsb + WHOLE - WHOLE) : x;
}
#endif

/*
$card
 *
 * C99, no library but libm, no allocation, no state: thread-safe. Compile with
 *     cc -std=c99 -O3 -march=native -ffp-contract=fast -c FILE.c
 * With -ffast-math NaN among the inputs may not be found. A batch takes at most $stack KiB of stack. For the
 * declarations alone, #define ${PREFIX}_DECLARATIONS before #include "FILE.c".
 *
 * Inputs: $inputs.
 * Loads: $loads.
 */
#ifndef ${PREFIX}_INCLUDED
#define ${PREFIX}_INCLUDED
#include <stddef.h>

typedef $real ${prefix}_real;
#define ${PREFIX}_INPUTS $count
#define ${PREFIX}_LOADS $outputs

#ifdef __cplusplus
extern "C" {
#endif
/* Loads of one case. jacobian[load][input] = d loads / d inputs may be NULL.
 * Returns 0 inside the trained ranges, 1 outside of them (extrapolated), 2 if an input is not finite
 * or beyond what the flow solver accepts; loads and jacobian are untouched then. */
int ${prefix}_loads(const ${prefix}_real *inputs, ${prefix}_real *loads, ${prefix}_real *jacobian);

/* Loads of count cases: inputs[case][input], loads[case][load], jacobian[case][load][input] or NULL,
 * status[case] as above or NULL. Returns the largest status. */
int ${prefix}_loads_batch(size_t count, const ${prefix}_real *inputs, ${prefix}_real *loads,
                          ${prefix}_real *jacobian, unsigned char *status);
#ifdef __cplusplus
}
#endif
#endif

#ifndef ${PREFIX}_DECLARATIONS
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

typedef ${prefix}_real real;
#ifdef __AVX512F__ /* twice as many registers, each twice as wide */
enum { BLOCK = $wide_block }; /* cases that are evaluated at once */
#else
enum { BLOCK = $block };
#endif
enum { INPUTS = $count, FEATURES = $features, LOADS = $outputs, HEADS = $heads, LAYERS = $layers,
       WIDEST = $widest, NODES = $nodes, WAVES = 5, INCIDENCE = $incidence,
       DESCRIPTIONS = $descriptions };
#define R(name) name$suffix

$data

/* Absolute error below 4 units of rounding of 1. Without branches or calls, so that compilers
 * vectorise loops of it. */
static inline real ${prefix}_tanh(real x)
{
    /* min(|x|, saturated), compared as integers: GCC does not vectorise floating-point comparisons
     * without AVX-512 unless -fno-trapping-math is given. */
    real size = $saturated;
    $bits least, bits;
    memcpy(&least, &size, sizeof least);
    memcpy(&bits, &x, sizeof bits);
    bits &= ($bits)-1 >> 1;
    bits = bits < least ? bits : least;
    memcpy(&size, &bits, sizeof size);
    const real power = R(rint)(-2 * size * $log2e), shifted = power + $magic; /* its last bits are power's */
    const real rest = (-2 * size - power * $ln2_high) - power * $ln2_low;
    real e = $last;
$horner
    $bits scale;
    memcpy(&scale, &shifted, sizeof scale);
    scale = (scale + $offset) << $mantissa;
    real two;
    memcpy(&two, &scale, sizeof two);
    e *= two; /* exp(-2 |x|) */
    return R(copysign)((1 - e) / (1 + e), x);
}
$single
$batch
static int ${prefix}_status(const real *inputs)
{
    for (int k = 0; k < INPUTS; k++)
        if (!(inputs[k] >= LEAST[k] && inputs[k] <= MOST[k])) return 2;
    const real log_re = R(log)(inputs[INPUTS - 1]);
    for (int d = 0; d < DESCRIPTIONS; d++) { /* of the body or of its mirror image */
        int inside = 1;
        for (int k = 0; k < INPUTS; k++) {
            const real x = k == INPUTS - 1 ? log_re : inputs[k], u = SIGN[d][k] * x + OFFSET[d][k];
            inside &= u >= LOW[k] && u <= HIGH[k];
        }
        if (inside) return 0;
    }
    return 1;
}

int ${prefix}_loads(const real *inputs, real *loads, real *jacobian)
{
    const int status = ${prefix}_status(inputs);
    if (status < 2) ${prefix}_cases_1(inputs, loads, jacobian);
    return status;
}

int ${prefix}_loads_batch(size_t count, const real *inputs, real *loads, real *jacobian,
                          unsigned char *status)
{
    int worst = 0;
    for (size_t start = 0; start < count; start += BLOCK) {
        const real *x = inputs + start * INPUTS;
        real *y = loads + start * LOADS, *by = NULL;
        if (jacobian != NULL) by = jacobian + start * LOADS * INPUTS;
        const int size = count - start < BLOCK ? (int)(count - start) : (int)BLOCK;
        int each[BLOCK], most = 0;
        for (int v = 0; v < size; v++) {
            each[v] = ${prefix}_status(x + v * INPUTS);
            if (each[v] > most) most = each[v];
            if (status != NULL) status[start + (size_t)v] = (unsigned char)each[v];
        }
        if (most > worst) worst = most;
        if (most < 2 && size == BLOCK)
            ${prefix}_cases_block(x, y, by);
        else
            for (int v = 0; v < size; v++)
                if (each[v] < 2)
                    ${prefix}_cases_1(x + v * INPUTS, y + v * LOADS,
                                      by ? by + v * LOADS * INPUTS : NULL);
    }
    return worst;
}
#endif

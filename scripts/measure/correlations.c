/* Correlations of particle codes in C, as fast as they are there: one call for many particles.
 * inputs[case] = aspect, flatness, beta2, incidence in degrees, Re; loads[case] = Cd, Cl, Cm. */
#include <math.h>
#include <stddef.h>
#include <tgmath.h>

#ifndef REAL
#define REAL double
#endif
typedef REAL real;
enum { INPUTS = 5, LOADS = 3 };
static const real RADIAN = (real)0.017453292519943295, HALF_PI = (real)1.5707963267948966;
static const real LOG_10 = (real)2.302585092994046;

/* Froehlich et al. 2020, prolate spheroids. */
void froehlich(size_t count, const real *inputs, real *loads)
{
    for (size_t i = 0; i < count; i++) {
        const real b = inputs[i * INPUTS], phi = RADIAN * inputs[i * INPUTS + 3];
        const real re = inputs[i * INPUTS + 4], l = log(b), q = sqrt(b * b - 1);
        const real k = log((b - q) / (b + q)), logs = log(re);
        const real s0 = -b * k / q, s1 = b * b / (q * q) + b * k / (2 * q * q * q);
        const real s3 = -2 / (q * q) - b * k / (q * q * q);
        const real along = 1 / (s0 + b * b * s3), across = 1 / (s0 + s1);
        const real sphere = 1 + (real)0.15 * exp((real)0.687 * logs);
        const real at_0 = sphere - (real)0.007 * l * exp(((real)1.17 - (real)0.07 * l) * logs);
        const real at_90 = sphere + (real)0.047 * pow(l, (real)1.14)
                                        * exp(((real)0.7 - (real)0.008 * l) * logs);
        const real scale = 64 / re * exp(l * 2 / 3), s = sin(phi), c = cos(phi);
        const real power = 1 + (real)0.01 * pow(l, (real)0.86) * pow(logs, (real)1.77);
        const real turn = HALF_PI * pow(phi / HALF_PI, power);
        const real torque = (real)0.931 * pow(l, (real)0.675) * exp((real)-0.162 * logs)
            + (real)0.657 * pow(l, (real)2.77) * exp(-((real)0.178 + (real)0.177 * l) * logs);
        real *to = loads + i * LOADS;
        to[0] = scale * (at_0 * along + (at_90 * across - at_0 * along) * s * s);
        to[1] = scale * sin(turn) * cos(turn) * (across - along)
            * (1 + (real)0.34 * exp(((real)0.88 - (real)0.05 * l) * logs));
        to[2] = s * c * torque;
    }
}

/* Zastawny et al. 2012, drag of prolate spheroids of aspect 2.5 and 1.25 (no others). */
void zastawny(size_t count, const real *inputs, real *loads)
{
    static const real constants[2][9] = {
        {2, (real)5.1, (real)0.48, (real)15.52, (real)1.05, (real)24.68, (real)0.98, (real)3.19,
         (real)0.21},
        {(real)1.95, (real)18.12, (real)1.023, (real)4.26, (real)0.384, (real)21.52, (real)0.99,
         (real)2.86, (real)0.26}};
    for (size_t i = 0; i < count; i++) {
        const real *a = constants[inputs[i * INPUTS] < (real)1.875], logs = log(inputs[i * INPUTS + 4]);
        const real at_0 = a[1] * exp(-a[2] * logs) + a[3] * exp(-a[4] * logs);
        const real at_90 = a[5] * exp(-a[6] * logs) + a[7] * exp(-a[8] * logs);
        const real s = sin(RADIAN * inputs[i * INPUTS + 3]);
        loads[i * LOADS] = at_0 + (at_90 - at_0) * pow(s, a[0]);
        loads[i * LOADS + 1] = loads[i * LOADS + 2] = 0;
    }
}

/* Area of an ellipsoid as the stream sees it, over the cross-section of the sphere. */
static real front(const real *input)
{
    const real phi = RADIAN * input[3], c = cos(phi), s = input[0] * sin(phi);
    return exp(log(input[0]) * (real)(-2.0 / 3)) * sqrt(c * c + input[1] * s * s);
}

/* Hoelzer, Sommerfeld 2008 with the crosswise sphericity; each particle's sphericity is known. */
void hoelzer_sommerfeld(size_t count, const real *inputs, const real *sphericity, real *loads)
{
    for (size_t i = 0; i < count; i++) {
        const real seen = front(inputs + i * INPUTS), re = inputs[i * INPUTS + 4], p = sphericity[i];
        loads[i * LOADS] = 8 * sqrt(seen) / re + 16 / (re * sqrt(p))
            + 3 / (sqrt(re) * exp((real)0.75 * log(p)))
            + (real)0.42 * exp((real)0.4 * LOG_10 * pow(fmax(-log10(p), (real)0), (real)0.2)) * seen;
        loads[i * LOADS + 1] = loads[i * LOADS + 2] = 0;
    }
}

/* Ganser 1993 with the area that the stream sees; each particle's sphericity is known. */
void ganser(size_t count, const real *inputs, const real *sphericity, real *loads)
{
    for (size_t i = 0; i < count; i++) {
        const real seen = front(inputs + i * INPUTS), re = inputs[i * INPUTS + 4], p = sphericity[i];
        const real stokes = 3 / (sqrt(seen) + 2 / sqrt(p));
        const real power = (real)1.8148 * pow(fmax(-log10(p), (real)0), (real)0.5743);
        const real newton = exp(LOG_10 * power), share = re * stokes * newton;
        loads[i * LOADS] = newton * (24 / share * (1 + (real)0.1118 * exp((real)0.6567 * log(share)))
            + (real)0.4305 / (1 + 3305 / share));
        loads[i * LOADS + 1] = loads[i * LOADS + 2] = 0;
    }
}

/* Bagheri, Bonadonna 2016, over random orientations: the incidence is not looked at. */
void bagheri_bonadonna(size_t count, const real *inputs, real *loads)
{
    for (size_t i = 0; i < count; i++) {
        const real b = inputs[i * INPUTS], wide = sqrt(inputs[i * INPUTS + 1]);
        const real re = inputs[i * INPUTS + 4], least = fmin(b, 1 / wide), most = fmax(b, wide);
        const real middle = b / (least * most), flat = log(least / middle), slim = log(middle / most);
        const real root = exp((flat + (real)1.3 * slim) / 3), slow = (root + 1 / root) / 2;
        const real fast = exp((real)-0.45 * (2 * flat + slim)), share = re * fast / slow;
        loads[i * LOADS] = 24 * slow / re * (1 + (real)0.125 * exp(log(share) * 2 / 3))
            + (real)0.46 * fast / (1 + 5330 / share);
        loads[i * LOADS + 1] = loads[i * LOADS + 2] = 0;
    }
}

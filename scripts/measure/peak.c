/* What a processor can do at most: multiply-adds, and the tanh of an exported surrogate ("peak.h"). */
#include "peak.h" /* the exported surrogate, with the prefix peak */

enum { CHAINS = 96 }; /* independent sums: enough to hide the latency of an instruction */

/* rounds * CHAINS multiply-adds. */
real peak_multiply_adds(long rounds, real factor)
{
    real sums[CHAINS];
    for (int k = 0; k < CHAINS; k++) sums[k] = (real)k;
    for (long n = 0; n < rounds; n++)
        for (int k = 0; k < CHAINS; k++) sums[k] = sums[k] * factor + factor;
    real total = 0;
    for (int k = 0; k < CHAINS; k++) total += sums[k];
    return total;
}

/* rounds * CHAINS times tanh. */
real peak_tanhs(long rounds, real factor)
{
    real values[CHAINS];
    for (int k = 0; k < CHAINS; k++) values[k] = factor * (real)k;
    for (long n = 0; n < rounds; n++)
        for (int k = 0; k < CHAINS; k++) values[k] = peak_tanh(values[k] + factor);
    real total = 0;
    for (int k = 0; k < CHAINS; k++) total += values[k];
    return total;
}

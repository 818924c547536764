/* Operations on doubles whose meaning does not depend on the compiler.
 *
 * No operation is fused unless fused() is called (the kernel is compiled with -ffp-contract=off). smaller() and
 * larger() compare the second number with the first one, so that a NaN is treated the same way everywhere.
 */
#ifndef HENON_NUMBERS_H
#define HENON_NUMBERS_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Distance from 1 to the next double. */
#define EPS 0x1p-52

/* a b + c, rounded once. */
static inline double fused(double a, double b, double c)
{
    return __builtin_fma(a, b, c);
}

static inline double smaller(double a, double b)
{
    return b < a ? b : a;
}

static inline double larger(double a, double b)
{
    return b > a ? b : a;
}

static inline int64_t least(int64_t a, int64_t b)
{
    return b < a ? b : a;
}

/* Bits of a double as an integer. */
static inline int64_t bits(double number)
{
    int64_t pattern;
    memcpy(&pattern, &number, sizeof pattern);
    return pattern;
}

/* Double with given bits. */
static inline double from_bits(uint64_t pattern)
{
    double number;
    memcpy(&number, &pattern, sizeof number);
    return number;
}

/* Integer power, exponent >= 0, by repeated squaring. */
static inline double whole_power(double base, int64_t exponent)
{
    double power = 1.0;
    for (; exponent > 0; exponent >>= 1) {
        if (exponent & 1)
            power *= base;
        base *= base;
    }
    return power;
}

#endif

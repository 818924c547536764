/* Operations on doubles, each with one meaning whatever the compiler may do to others.
 *
 * Nothing is fused that is not said to be (the kernel is compiled with -ffp-contract=off), and of two numbers the
 * comparison looks at the second one first, so that what is no number has one way through.
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

/* The bits of a double as an integer. */
static inline int64_t bits(double number)
{
    int64_t pattern;
    memcpy(&pattern, &number, sizeof pattern);
    return pattern;
}

/* The double with these bits. */
static inline double from_bits(uint64_t pattern)
{
    double number;
    memcpy(&number, &pattern, sizeof number);
    return number;
}

/* A whole power, not negative, by repeated squaring. */
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

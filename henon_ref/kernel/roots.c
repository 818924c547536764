/* Roots of a guard's Taylor polynomial on one step: isolation of the first falling root, without omissions.
 *
 * A bound excludes roots on most steps (positive_by_bound). If it does not, the signs of the Bernstein coefficients on
 * the step count the roots (Descartes' rule; henon_ref/taylor/llvm/step.py), with subdivision until the first falling
 * root is isolated or the polynomial is zero to rounding (a tangential root). A piece that may hold two roots or none
 * is cut on both sides of its minimum, which leaves few cases undecided; any other piece is halved.
 */
#ifndef HENON_ROOTS_C
#define HENON_ROOTS_C

#include "kernel.h"
#include "numbers.h"

/* A piece on which the polynomial is no larger than this multiple of its rounding noise is a touch. */
#define CLEARANCE 4.0
/* Known zeros of order m are divided out only if coefficients 0 to m - 1 are below this part of coefficient m. */
#define KNOWN_ZERO_LEVEL 1e-9
/* Number of pieces after which pieces are only halved. */
#define CUT_PIECES 32
/* Newton steps towards the minimum of a piece. */
#define MINIMUM_STEPS 6
/* Distance from a minimum to the cuts on both sides, at least and at most, as parts of the piece. */
#define CUT_LEAST 0x1p-20
#define CUT_MOST 0x1p-3

/* A piece of the step, or two places on it. */
struct piece {
    double low, high;
};

/* theta^0 ... theta^order, four at a time; "powers" has room for a multiple of four. */
static inline void powers_of(double theta, double *powers, int64_t order)
{
    double square = theta * theta, fourth = square * square;
    double a = 1.0, b = theta, c = square, d = theta * square;
    for (int64_t k = 0; k <= order; k += 4) {
        powers[k] = a, powers[k + 1] = b, powers[k + 2] = c, powers[k + 3] = d;
        a *= fourth, b *= fourth, c *= fourth, d *= fourth;
    }
}

/* Check whether q > 0 on the whole step by its negative terms alone (q[k] powers[k] at the step's end). */
static inline bool positive_by_bound(const double *q, const double *powers, int64_t degree)
{
    double odd = 0.0, even = 0.0; /* two independent sums, which the processor computes in parallel; likewise below */
    for (int64_t k = 1; k < degree; k += 2) {
        odd += smaller(q[k] * powers[k], 0.0);
        even += smaller(q[k + 1] * powers[k + 1], 0.0);
    }
    if (degree % 2 == 1)
        odd += smaller(q[degree] * powers[degree], 0.0);
    return q[0] + (odd + even) > 0.0;
}

/* q(tau) by Horner's rule. */
static inline double value(const double *q, int64_t degree, double tau)
{
    double total = q[degree];
    for (int64_t k = degree - 1; k >= 0; k--)
        total = fused(total, tau, q[k]);
    return total;
}

/* Factor of a polynomial's known zeros, and the quotient; false if the first coefficients are not next to zero.
 *
 * A guard is known to be zero where it has just been left, but the rounding of the state makes it slightly different
 * from zero. If the first coefficients were simply dropped, the other roots would move by this difference, and multiple
 * roots by a root of it. Iterated division gives the factor t^m + a_(m-1) t^(m-1) + ... + a_0 with very small
 * coefficients.
 */
static inline bool deflated(const double *c, int64_t zeros, int64_t degree, double *factor, double *quotient)
{
    int64_t size = degree + 1 - zeros;
    if (size < 2)
        return false;
    for (int64_t i = 0; i < zeros; i++) {
        factor[i] = 0.0;
        if (!(fabs(c[i]) <= KNOWN_ZERO_LEVEL * fabs(c[zeros])))
            return false;
    }
    for (int step = 0; step < 3; step++) {
        for (int64_t k = size - 1; k >= 0; k--) {
            int64_t first = zeros + k - size + 1;
            quotient[k] = c[k + zeros];
            for (int64_t j = first > 0 ? first : 0; j < zeros; j++)
                quotient[k] -= factor[j] * quotient[k + zeros - j];
        }
        for (int64_t i = 0; i < zeros; i++) {
            factor[i] = c[i];
            for (int64_t j = 0; j < i; j++)
                factor[i] -= i - j < size ? factor[j] * quotient[i - j] : 0.0;
            factor[i] /= quotient[0];
        }
    }
    return true;
}

/* Bernstein coefficients of both parts of the piece in "right" (de Casteljau's algorithm, in place). */
static inline void cut(double *left, double *right, int64_t degree, double part)
{
    for (int64_t i = 0; i <= degree; i++) {
        double here = left[i] = right[0];
        for (int64_t j = 0; j < degree - i; j++) { /* one by one: vectors would wait for the stores of the last pass */
            double next = right[j + 1];
            right[j] = fused(part, next - here, here), here = next;
        }
    }
}

/* Two places on both sides of a minimum at tau whose value is noise; q exceeds the noise at both if possible.
 *
 * "bend": second derivative there, approximately. "distance": smallest distance to either side.
 */
static inline struct piece around_touch(const double *a, int64_t degree, double tau, double bend, double distance,
                                        double width, double noise)
{
    double clear = CLEARANCE * noise;
    if (bend > 0.0) { /* places of a parabola midway between noise and a touch, so that only the middle is a touch */
        double near = sqrt((noise + clear) / bend);
        double left = value(a, degree, tau - near), right = value(a, degree, tau + near);
        if (near < CUT_MOST * width && smaller(left, right) > noise && larger(left, right) < clear)
            return (struct piece){tau - near, tau + near};
    }
    while (distance < CUT_MOST * width
           && smaller(value(a, degree, tau - distance), value(a, degree, tau + distance)) <= clear)
        distance *= 4.0;
    distance = smaller(distance, CUT_MOST * width);
    return (struct piece){tau - distance, tau + distance};
}

/* Two places on a piece, on both sides of its minimum, close to it but clear of it if possible; else its middle, twice.
 *
 * Newton's method on the slope over its derivative (Schroeder 1870), of which flat minima are simple roots, too.
 */
static inline struct piece around_minimum(const double *a, int64_t degree, double low, double high, double noise)
{
    double width = high - low, middle = low + 0.5 * width;
    double tau = middle, shift = 0.0, bend = 0.0;
    struct piece halves = {middle, middle};
    for (int step = 0; step < MINIMUM_STEPS; step++) {
        double slope = (double)degree * a[degree], twist = 0.0; /* twist is half the third derivative */
        bend = 0.0;
        for (int64_t k = degree - 1; k > 0; k--) {
            twist = fused(twist, tau, bend);
            bend = fused(bend, tau, slope);
            slope = fused(slope, tau, (double)k * a[k]);
        }
        if (fabs(slope) <= noise) {
            shift = 0.0;
            break;
        }
        double below = fused(bend, bend, -2.0 * slope * twist);
        if (!(bend > 0.0 && below > 0.0))
            return halves;
        shift = -slope * bend / below;
        tau += shift;
        if (!(low < tau && tau < high))
            return halves;
        if (fabs(shift) <= CUT_LEAST * width)
            break;
    }
    double distance = larger(8.0 * fabs(shift), CUT_LEAST * width);
    if (!(distance < CUT_MOST * width))
        return halves;
    if (fabs(value(a, degree, tau)) <= noise)
        return around_touch(a, degree, tau, bend, distance, width, noise);
    return (struct piece){tau - distance, tau + distance};
}

/* Signs of the Bernstein coefficients of a piece. */
struct signs {
    int64_t first, last; /* signs of the first and the last nonzero coefficient */
    int64_t clear;       /* sign of the first coefficient larger than the noise */
    int64_t changes;     /* number of sign changes */
    double largest;      /* largest coefficient in size */
    double lowest;       /* smallest inner coefficient; those at the ends are values, tested where two pieces meet */
};

static inline struct signs signs_on(const double *b, int64_t degree, double noise, double size)
{
    struct signs s = {.lowest = 2.0 * size};
    for (int64_t i = 0; i <= degree; i++) {
        s.largest = larger(s.largest, fabs(b[i]));
        if (0 < i && i < degree)
            s.lowest = smaller(s.lowest, b[i]);
        if (s.clear == 0 && fabs(b[i]) > noise)
            s.clear = b[i] > 0.0 ? 1 : -1;
        if (b[i] != 0.0) {
            int64_t sign = b[i] > 0.0 ? 1 : -1;
            if (s.last == 0)
                s.first = sign;
            else if (sign != s.last)
                s.changes += 1;
            s.last = sign;
        }
    }
    return s;
}

/* Isolate the first root on (0, 1] through which the polynomial falls.
 *
 * Pieces are examined from left to right (Lane and Riesenfeld, BIT 21, 1981). Descartes' rule: no sign change, no root;
 * one change, one root, which is skipped if it rises, that is if the piece begins below zero. "before": sign with which
 * the last skipped piece ended.
 *
 * a: coefficients in powers of a variable on [0, 1]. stack: DEPTH + 2 rows, their width a multiple of four above
 * degree; the first row holds the Bernstein coefficients on [0, 1], the others are work space.
 */
static inline struct first_root first_falling_root(const double *a, int64_t degree, double *stack, int64_t width)
{
    struct piece pieces[DEPTH + 2];
    double size = 0.0;
    for (int64_t k = 0; k <= degree; k++)
        size += fabs(a[k]);
    double noise = 4.0 * EPS * size;
    int64_t top = 1, looked_at = 0, before = 0;
    pieces[0] = (struct piece){0.0, 1.0};
    while (top > 0) {
        top -= 1;
        looked_at += 1;
        const double *b = stack + top * width;
        double low = pieces[top].low, high = pieces[top].high;
        struct signs s = signs_on(b, degree, noise, size);
        if (before > 0 && s.first < 0)
            return (struct first_root){ROOT, low, low};
        if (before > 0 && s.first > 0 && b[0] <= noise) /* zero at a cut, positive on both sides */
            return (struct first_root){s.clear < 0 ? ROOT : TANGENTIAL, low, low};
        bool unclear = s.first > 0 && s.lowest <= noise; /* rounding may hide an even number of roots */
        if ((s.changes == 0 && !unclear) || (s.changes == 1 && s.first < 0)) {
            before = s.last != 0 ? s.last : before;
            continue;
        }
        if (s.changes == 1)
            return (struct first_root){ROOT, low, high};
        if (s.largest <= CLEARANCE * noise || top + 2 > DEPTH || high - low < 4.0 * EPS)
            return (struct first_root){TANGENTIAL, low, high};
        double middle = 0.5 * (low + high);
        struct piece cuts = {middle, middle};
        if (s.first > 0 && looked_at < CUT_PIECES)
            cuts = around_minimum(a, degree, low, high, noise);
        const double places[2] = {cuts.high, cuts.low};
        for (int k = 0; k < 2; k++) {
            double at = places[k];
            if (low < at && at < high) {
                cut(stack + (top + 1) * width, stack + top * width, degree, (at - low) / (high - low));
                pieces[top] = (struct piece){at, high};
                high = at;
                top += 1;
            }
        }
        pieces[top] = (struct piece){low, high};
        top += 1;
    }
    return (struct first_root){NO_ROOT, 0.0, 0.0};
}

/* Relative steepness of q at tau: -tau q'(tau) over the size of its terms there; small near a double root.
 *
 * powers: room for the powers of tau.
 */
static inline double steepness(const double *q, int64_t degree, double tau, double *powers)
{
    powers_of(tau, powers, degree);
    double slope = 0.0, slope_between = 0.0, size = 0.0, size_between = 0.0;
    for (int64_t k = degree; k > 0; k -= 2) {
        double term = q[k] * powers[k], between = q[k - 1] * powers[k - 1];
        slope = fused((double)k, term, slope), slope_between = fused((double)(k - 1), between, slope_between);
        size += fabs(term), size_between += fabs(between);
    }
    if (degree % 2 == 0)
        size_between += fabs(q[0]);
    return -(slope + slope_between) / (size + size_between);
}

/* Value and slope of q at 1. */
static inline void at_end(const double *q, int64_t degree, double *end, double *end_slope)
{
    double total = 0.0, total_between = 0.0, slope = 0.0, slope_between = 0.0;
    for (int64_t k = degree; k > 0; k -= 2) {
        total += q[k], total_between += q[k - 1];
        slope = fused((double)k, q[k], slope), slope_between = fused((double)(k - 1), q[k - 1], slope_between);
    }
    if (degree % 2 == 0)
        total_between += q[0];
    *end = total + total_between;
    *end_slope = slope + slope_between;
}

#endif

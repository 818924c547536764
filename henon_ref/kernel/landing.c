/* Landing: the last step of event location, onto an isolated root of a guard on the step.
 *
 * Henon's method (Physica D 5, 1982) exchanges the variables t and h, the guard: dt/dh = 1/h', and one step of -h leads
 * from a point near the surface onto it. Here this step has order 4, by reversion of the series. Newton's and Brent's
 * methods can replace it. The bracket of the root safeguards all three.
 */
#ifndef HENON_LANDING_C
#define HENON_LANDING_C

#include "roots.c"

/* An inverse cubic is used if the slope at both ends is at least a third of the chord's: then the cubic is monotone
 * (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980). */
#define CUBIC_STEEPNESS 3.0

/* Root by the cubic in h that has the guard's values and slopes at both ends of [0, 1] (Hermite's interpolation).
 *
 * "part" of the guard's fall lies before the root. first, last: slopes of the inverse, relative to its chord's.
 */
static inline double interpolated(double part, double first, double last)
{
    double rest = 1.0 - part;
    return part * fused(part, fused(2.0, rest, 1.0), rest * fused(rest, first, -part * last));
}

/* Taylor coefficients 0 to 4 of q around tau, or only 0 and 1 with "order_one". */
static inline void around(const double *q, int64_t degree, double tau, bool order_one, double g[5])
{
    double g0 = q[degree], g1 = 0.0, g2 = 0.0, g3 = 0.0, g4 = 0.0;
    for (int64_t k = degree - 1; k >= 0; k--) {
        if (!order_one) {
            g4 = fused(g4, tau, g3);
            g3 = fused(g3, tau, g2);
            g2 = fused(g2, tau, g1);
        }
        g1 = fused(g1, tau, g0);
        g0 = fused(g0, tau, q[k]);
    }
    g[0] = g0, g[1] = g1, g[2] = g2, g[3] = g3, g[4] = g4;
}

/* Step to the zero by the reversed series in h, of order 4 (Lagrange inversion).
 *
 * u = -h / h' is Newton's step, "inverse" = 1 / h', b_k = g_k / g_1. "error": relative error, about the first omitted
 * term, of size u^4; 1 if the series does not converge.
 */
static inline double reverted(double u, double inverse, const double g[5], double *error)
{
    double b2 = g[2] * inverse, b3 = g[3] * inverse, b4 = g[4] * inverse;
    double second = fabs(b2 * u), third = fabs(b3 * u * u), fourth = fabs(b4 * u * u * u);
    *error = 1.0;
    if (second > 0.125 || third > 0.015 || fourth > 0.002)
        return u;
    /* 1 - b2 u + (2 b2^2 - b3) u^2 + (5 b2 b3 - b4 - 5 b2^3) u^3 */
    double three = fused(2.0 * b2, b2, -b3), four = fused(5.0 * b2, fused(-b2, b2, b3), -b4);
    double square = second * second;
    *error = square * square + third * third + fourth * larger(second, third);
    return u * fused(u, fused(u, fused(u, four, three), -b2), 1.0);
}

static inline struct landed bisect(const double *q, int64_t degree, double left, double right, int64_t evaluations)
{
    for (int64_t made = 0; right - left > 2.0 * EPS * right && made < 200; made++) {
        double middle = 0.5 * (left + right);
        if (middle <= left || middle >= right)
            break;
        evaluations += 1;
        if (value(q, degree, middle) > 0.0)
            left = middle;
        else
            right = middle;
    }
    return (struct landed){0.5 * (left + right), BRACKET, evaluations};
}

/* Start of a landing: the root of an inverse cubic if the guard falls evenly over the whole step, else that of the
 * chord; the middle of the bracket if rounding dominates the value at "high". */
static inline double landing_start(const double *q, int64_t degree, double low, double high, int64_t *evaluations)
{
    /* A root at "high" itself is not the bracketed one: q is negative just before it. */
    double below = q[0], above, slope;
    *evaluations = 0;
    if (low > 0.0)
        below = value(q, degree, low), *evaluations = 1;
    at_end(q, degree, &above, &slope);
    if (high < 1.0)
        above = value(q, degree, high), *evaluations += 1;
    if (!(below > 0.0 && above < -0.01 * below)) /* another root next to "high" may leave only rounding */
        return 0.5 * (low + high);
    double part = below / (below - above), fall = above - below;
    if (low == 0.0 && high == 1.0 && CUBIC_STEEPNESS * q[1] < fall && CUBIC_STEEPNESS * slope < fall)
        return interpolated(part, fall / q[1], fall / slope);
    return fused(high - low, part, low);
}

/* Find the root of a falling q in the bracket [low, high], within [0, 1].
 *
 * HENON: exchange the variables t and h (Henon 1982; Eq. (14) of Olejnik and Awrejcewicz, 2013) and take one Taylor
 * step of order 4 in h, of length -h, from a point near the surface: the Taylor series of dt/dh = 1/h' is the reversion
 * of that of h. landing_start gives the point. The step is repeated once if the first was long. If the exchanged series
 * does not converge (near a graze), the falling root of the guard's parabola leads closer. NEWTON: the same iteration
 * with order 1 (BRENT: see brent). If the iteration fails, bisection finds the root, and the landing is BRACKET.
 */
static inline struct landed land(const double *q, int64_t degree, double low, double high, int64_t method)
{
    if (low == high)
        return (struct landed){low, method, 0};
    int64_t evaluations;
    double left = low, right = high, tau = landing_start(q, degree, low, high, &evaluations);
    bool order_one = method == NEWTON;
    double before = 1.0, g[5];
    for (int step = 0; step < 12; step++) {
        around(q, degree, tau, order_one, g);
        double g0 = g[0], g1 = g[1], g2 = g[2];
        evaluations += 1;
        if (g0 > 0.0)
            left = tau;
        else
            right = tau;
        double bend = fused(g1, g1, -4.0 * g0 * g2);
        if (g1 >= 0.0 && (order_one || !(g2 < 0.0 && bend > 0.0))) { /* before or after the fall */
            tau = 0.5 * (left + right);
            continue;
        }
        double u = g1 < 0.0 ? -g0 / g1 : 1.0, delta = u, error = 1.0;
        if (!order_one) {
            if (g1 < 0.0)
                delta = reverted(u, 1.0 / g1, g, &error);
            if (error == 1.0) { /* the exchanged series does not converge from here: approach the root first */
                if (bend > 0.0) { /* falling root of the parabola, a good guess near a double root */
                    double root = sqrt(bend);
                    delta = g1 <= 0.0 ? 2.0 * g0 / (root - g1) : -0.5 * (g1 + root) / g2;
                }
                if (!(low < tau + delta && tau + delta < high))
                    delta = 0.5 * (left + right) - tau;
            }
        }
        double new = tau + delta;
        if (!(left <= new && new <= right)) {
            new = smaller(larger(new, left), right);
            if ((new == left || new == right) && fabs(delta) > 8.0 * EPS * right) {
                tau = 0.5 * (left + right);
                continue;
            }
        }
        double moved = fabs(new - tau);
        tau = new;
        if (moved <= 2.0 * EPS * new || error * moved <= 0.25 * EPS * new)
            return (struct landed){tau, method, evaluations};
        if (error < 1.0 && moved >= 0.5 * before) /* no progress: the rest of the guard is rounding */
            return (struct landed){tau, method, evaluations};
        before = error < 1.0 ? moved : 1.0;
    }
    return bisect(q, degree, left, right, evaluations);
}

/* Brent's method, by bracketing alone (Algorithms for Minimization without Derivatives, 1973, Ch. 4).
 *
 * The root is -1 if the guard does not change sign between the ends of the interval.
 */
static inline struct landed brent(const double *q, int64_t degree, double low, double high)
{
    if (low == high)
        return (struct landed){low, BRENT, 0};
    double a = low, b = high, fa = q[0], fb = value(q, degree, high);
    int64_t evaluations = 0;
    if (low > 0.0)
        fa = value(q, degree, low), evaluations = 1;
    if (high < 1.0)
        evaluations += 1;
    if (!(fa > 0.0 && 0.0 > fb))
        return (struct landed){-1.0, BRENT, 0};
    double c = a, fc = fa, d = b - a, e = d;
    while (evaluations < 200) {
        if (fabs(fc) < fabs(fb)) {
            a = b, b = c, c = a;
            fa = fb, fb = fc, fc = fa;
        }
        double tolerance = EPS * fabs(b), half = 0.5 * (c - b);
        if (fabs(half) <= tolerance || fb == 0.0)
            break;
        if (fabs(e) >= tolerance && fabs(fa) > fabs(fb)) {
            double s = fb / fa, p, r;
            if (a == c) {
                p = 2.0 * half * s, r = 1.0 - s;
            } else {
                double u = fa / fc, v = fb / fc;
                p = s * (2.0 * half * u * (u - v) - (b - a) * (v - 1.0));
                r = (u - 1.0) * (v - 1.0) * (s - 1.0);
            }
            if (p > 0.0)
                r = -r;
            p = fabs(p);
            if (2.0 * p < smaller(3.0 * half * r - fabs(tolerance * r), fabs(e * r)))
                e = d, d = p / r;
            else
                d = e = half;
        } else {
            d = e = half;
        }
        a = b, fa = fb;
        b += fabs(d) > tolerance ? d : half > 0.0 ? tolerance : -tolerance;
        fb = value(q, degree, b);
        evaluations += 1;
        if ((fb > 0.0) == (fc > 0.0)) {
            c = a, fc = fa;
            d = e = b - a;
        }
    }
    return (struct landed){b, BRENT, evaluations};
}

#endif

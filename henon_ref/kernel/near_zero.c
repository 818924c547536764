/* Behaviour of a guard near a suspected zero, by its series in double-double: root, minimum, or neither. */

/* Radii of neighbourhoods of a place, relative to its distance: the largest, the factor to the next, the smallest. */
#define WIDEST 0x1p-3
#define NARROWER 0x1p-3
#define NARROWEST 0x1p-21
/* Number of halvings used to show that a guard is positive. */
#define HALVINGS 6
/* Radius, in the unit of the expansion, to which a root must be known: a part of a double's last place. */
#define KNOWN_PLACE 0x1p-58
/* A number is clearly not zero if it exceeds its error bound by this factor. */
#define CLEAR 2.0
/* Highest order of a zero or minimum that is recognised; Newton steps to its place; relative distance within which the
 * place counts as a double. */
#define FLATTEST 8
#define FLAT_STEPS 4
#define DOUBLE_PLACE 0x1p-80

/* Behaviour of a guard near the suspected place. TOUCHING: it touches zero exactly, in numbers that doubles hold. */
enum nearby { OPEN, RISING, VALLEY, TOUCHING, FALLING };

/* Behaviour, and its place: the minimum (VALLEY, TOUCHING) or the root (FALLING). */
struct near_place {
    int64_t what;
    struct pair at;
    double depth;  /* distance from zero of the number that decides */
    int64_t order; /* of the minimum or root */
};

/* Bernstein coefficients on [0, end] of a series without its first "zeros" terms. */
struct bernstein {
    int64_t degree; /* higher terms are negligible in doubles */
    double noise;   /* error bound of each coefficient */
    double b[PAIR_TERMS];
};

static void bernstein_of(const struct pair_expansion *e, const struct pair_series *q, int64_t zeros, double end,
                         struct bernstein *found)
{
    int64_t degree = e->terms - 1 - zeros;
    double size = 0.0, error = 0.0, power = 1.0, scaled[PAIR_TERMS], *b = found->b;
    for (int64_t k = 0; k <= degree; k++) {
        scaled[k] = q->high[zeros + k] * power;
        size += fabs(scaled[k]), error += q->error[zeros + k] * power;
        power *= end;
    }
    for (double left_out = 0.0; degree > 2; degree--) {
        left_out += fabs(scaled[degree]);
        if (left_out > 0.5 * EPS * size)
            break;
        error += fabs(scaled[degree]);
    }
    double choices = 1.0; /* binomial coefficients; sums of the scaled terms as in Pascal's triangle */
    for (int64_t k = degree; k >= 0; k--) {
        double carried = scaled[k] / choices;
        for (int64_t i = 0; i <= degree - k; i++) {
            double before = i < degree - k ? b[i] : 0.0;
            b[i] = carried;
            carried += before;
        }
        choices = choices * (double)k / (double)(degree - k + 1);
    }
    found->degree = degree;
    found->noise = 4.0 * (double)(degree + 2) * EPS * size + error;
}

/* Check whether a polynomial with these Bernstein coefficients is above a level. */
static bool above(const double *b, int64_t degree, double level, int64_t halvings)
{
    double lowest = INFINITY, left[PAIR_TERMS], right[PAIR_TERMS];
    for (int64_t i = 0; i <= degree; i++) {
        lowest = smaller(lowest, b[i]);
        right[i] = b[i];
    }
    if (lowest > level)
        return true;
    if (!(b[0] > level && b[degree] > level) || halvings == 0)
        return false;
    cut(left, right, degree, 0.5);
    return above(left, degree, level, halvings - 1) && above(right, degree, level, halvings - 1);
}

/* Shape by the differences of Bernstein coefficients: FALLING, RISING, VALLEY (one minimum), or OPEN. */
static int64_t shape_of(const double *b, int64_t degree, double noise)
{
    int64_t falling = 0, unclear = 0, rising = 0;
    for (int64_t i = 0; i < degree; i++) {
        double difference = b[i + 1] - b[i];
        if (difference > noise)
            rising += 1;
        else if (difference >= -noise)
            unclear += 1;
        else if (rising > 0)
            return OPEN;
        else
            falling += 1;
    }
    if (unclear == 0 && rising == 0)
        return FALLING;
    if (unclear == 0 && falling == 0)
        return RISING;
    return unclear <= 1 && falling > 0 && rising > 0 ? VALLEY : OPEN;
}

/* Value and first three derivatives of a series at a place, in doubles. */
static void derivatives(const struct pair_expansion *e, const struct pair_series *q, double at, double *found)
{
    found[0] = found[1] = found[2] = found[3] = 0.0;
    for (int64_t k = e->terms - 1; k >= 0; k--) {
        found[3] = fused(found[3], at, 3.0 * found[2]);
        found[2] = fused(found[2], at, 2.0 * found[1]);
        found[1] = fused(found[1], at, found[0]);
        found[0] = fused(found[0], at, q->high[k]);
    }
}

/* Zero of a derivative that changes its sign once between two places, in doubles: order 0 falls, order 1 rises. */
static double sign_change(const struct pair_expansion *e, const struct pair_series *q, int order, double low,
                          double high)
{
    double at = 0.5 * (low + high), found[4], before = high - low;
    for (int step = 0; step < 60; step++) {
        derivatives(e, q, at, found);
        if ((found[order] < 0.0) == (order == 1))
            low = at;
        else
            high = at;
        double new = at - found[order] / found[order + 1];
        if (!(low < new && new < high))
            new = 0.5 * (low + high);
        double moved = fabs(new - at);
        at = new;
        if (moved <= 2.0 * EPS * at || (moved < 1e-13 * at && moved >= 0.5 * before))
            break;
        before = moved;
    }
    return at;
}

/* Root of a falling guard near a place, by Newton's method in double-double; OPEN if it does not converge. */
static struct near_place falling_root(const struct pair_expansion *e, const struct pair_series *q, struct pair at)
{
    for (int step = 0; step < 4; step++) {
        struct powers powers;
        powers_at(e, at, &powers);
        struct bounded height = value_in_pairs(e, q, &powers.own), slope = value_in_pairs(e, q, &powers.sloped);
        if (!(slope.high < -CLEAR * slope.error))
            break;
        double found[4], shift = -height.high / slope.high;
        derivatives(e, q, at.high, found);
        double radius = (height.error + fabs(found[2]) * shift * shift) / -slope.high;
        struct pair exact = divided((struct pair){-height.high, -height.low}, (struct pair){slope.high, slope.low});
        at = added(at, exact);
        if (radius <= KNOWN_PLACE)
            return (struct near_place){FALLING, at, 0.0, 1};
    }
    return (struct near_place){.what = OPEN};
}

/* Check whether a number is zero without error. */
static inline bool exact_zero(struct bounded number)
{
    return number.high == 0.0 && number.low == 0.0 && number.error == 0.0;
}

/* Guard with one minimum between two places: VALLEY if that is above zero, else the guard's first root. */
static struct near_place at_minimum(const struct pair_expansion *e, const struct pair_series *q, double low,
                                    double high)
{
    double about = sign_change(e, q, 1, low, high), found[4];
    struct powers powers;
    powers_at(e, (struct pair){about, 0.0}, &powers);
    struct bounded height = value_in_pairs(e, q, &powers.own), slope = value_in_pairs(e, q, &powers.sloped);
    derivatives(e, q, about, found);
    double shift = -slope.high / found[2];
    height = bounded_sum(height, exactly(0.5 * slope.high * shift));
    double error = height.error + (fabs(slope.high) * EPS + slope.error) * fabs(shift)
                   + fabs(found[3] * shift * shift * shift);
    struct pair bottom = pair_sum(about, shift);
    if (!(found[2] > 0.0 && fabs(height.high) > CLEAR * error)) {
        powers_at(e, bottom, &powers);
        bool touching = found[2] > 0.0 && exact_zero(value_in_pairs(e, q, &powers.own))
                        && exact_zero(value_in_pairs(e, q, &powers.sloped));
        return (struct near_place){touching ? TOUCHING : OPEN, bottom, 0.0, 2};
    }
    if (height.high > 0.0)
        return (struct near_place){VALLEY, bottom, height.high, 2};
    /* root of the cubic about the minimum, starting from that of the parabola */
    double off = -sqrt(-2.0 * height.high / found[2]);
    for (int step = 0; step < 4; step++)
        off -= (height.high + off * off * (0.5 * found[2] + off * found[3] / 6.0))
               / (off * (found[2] + 0.5 * off * found[3]));
    struct near_place root = falling_root(e, q, added(bottom, (struct pair){off, 0.0}));
    bool inside = low < root.at.high && root.at.high < about;
    root.depth = -height.high;
    return root.what == FALLING && inside ? root : (struct near_place){.what = OPEN};
}

/* Taylor coefficient j of a series about a place: the sum over k of binomial(k, j) q[k] at^(k - j). */
static struct bounded local_term(const struct pair_expansion *e, const struct pair_series *q,
                                 const struct pair_series *powers, int64_t j)
{
    struct pair_series weights;
    double choices = 1.0; /* exact: below 2^53 for all orders in use */
    for (int64_t k = 0; k < e->terms; k++) {
        put_term(&weights, k, k < j ? exactly(0.0) : bounded_product(exactly(choices), term(powers, k - j)));
        if (k >= j)
            choices = choices * (double)(k + 1) / (double)(k + 1 - j);
    }
    return value_in_pairs(e, q, &weights);
}

/* All Taylor coefficients about a place, in doubles (repeated Horner's scheme). */
static void local_terms(const struct pair_expansion *e, const struct pair_series *q, double at, double *found)
{
    for (int64_t k = 0; k < e->terms; k++)
        found[k] = q->high[k];
    for (int64_t j = 0; j < e->terms; j++)
        for (int64_t k = e->terms - 2; k >= j; k--)
            found[k] = fused(at, found[k + 1], found[k]);
}

/* Order of the largest term after the first, on a neighbourhood. */
static int64_t largest_order(const struct pair_expansion *e, const double *local, double radius)
{
    double power = radius, largest = 0.0;
    int64_t found = 0;
    for (int64_t k = 1; k < e->terms; k++) {
        if (fabs(local[k]) * power > largest)
            largest = fabs(local[k]) * power, found = k;
        power *= radius;
    }
    return found;
}

/* Radius about a place within which the term of an order exceeds the sum of all later terms, in value and slope, and
 * before which the series is positive; 0 if there is none. */
static double flat_radius(const struct pair_expansion *e, const struct pair_series *q, double at, const double *local,
                          int64_t order)
{
    for (double radius = WIDEST * at; radius >= NARROWEST * at; radius *= NARROWER) {
        double rest = 0.0, power = radius;
        for (int64_t k = order + 1; k < e->terms; k++) {
            rest += (double)k / (double)order * fabs(local[k]) * power; /* of the slope, where later terms weigh more */
            power *= radius;
        }
        struct bernstein before;
        bernstein_of(e, q, 0, at - radius, &before);
        if (fabs(local[order]) > 2.0 * rest && above(before.b, before.degree, 2.0 * before.noise, HALVINGS))
            return radius;
    }
    return 0.0;
}

/* Guard that is flat near a place: a zero of higher order, in numbers that doubles hold, or a minimum above zero.
 *
 * About the zero of derivative m - 1, the guard is c_0 + ... + c_m h^m + ..., where the term of order m exceeds all
 * later ones. If c_0 to c_(m-1) are known to be exact zeros, the guard has a zero of order m. If m is even and c_m
 * positive, the guard is at least c_0 minus the sizes of the terms of order 1 to m - 1; and if c_0 is clearly negative,
 * it has one falling root before the place.
 */
static struct near_place flat_zero(const struct pair_expansion *e, const struct pair_series *q, double suspect)
{
    const struct near_place open = {.what = OPEN};
    double local[PAIR_TERMS], size = 0.0, power = 1.0;
    struct pair at = {suspect, 0.0};
    struct powers powers;
    local_terms(e, q, suspect, local);
    int64_t order = largest_order(e, local, WIDEST * suspect);
    if (order <= 2 || order > FLATTEST)
        return open;
    for (int step = 0; step < FLAT_STEPS; step++) {
        powers_at(e, at, &powers);
        struct bounded off = local_term(e, q, &powers.own, order - 1), slope = local_term(e, q, &powers.own, order);
        struct bounded steep = bounded_product(exactly((double)order), slope);
        struct pair shift = divided((struct pair){-off.high, -off.low}, (struct pair){steep.high, steep.low});
        if (shift.high == 0.0)
            break;
        at = added(at, shift);
    }
    if (fabs(at.low) <= DOUBLE_PLACE * at.high)
        at.low = 0.0;
    if (!(0.0 < at.high && at.high <= e->reach))
        return open;
    local_terms(e, q, at.high, local);
    double radius = flat_radius(e, q, at.high, local, order);
    powers_at(e, at, &powers);
    struct bounded lowest = local_term(e, q, &powers.own, 0);
    bool zero = exact_zero(lowest), valley = order % 2 == 0 && local[order] > 0.0;
    for (int64_t k = 1; k < order; k++) {
        struct bounded c = local_term(e, q, &powers.own, k);
        power *= radius, size += (fabs(c.high) + c.error) * power;
        zero = zero && exact_zero(c);
    }
    double error = lowest.error + size, depth = fabs(lowest.high) - error;
    if (radius == 0.0)
        return open;
    if (zero && (valley || (order % 2 == 1 && local[order] < 0.0)))
        return (struct near_place){valley ? TOUCHING : FALLING, at, 0.0, order};
    if (!(valley && depth > CLEAR * error))
        return open;
    if (lowest.high > 0.0)
        return (struct near_place){VALLEY, at, depth, order};
    double before = pow(-lowest.high / local[order], 1.0 / (double)order);
    struct near_place root = falling_root(e, q, added(at, (struct pair){-before, 0.0}));
    root.depth = depth;
    return root.what == FALLING && at.high - radius < root.at.high && root.at.high < at.high ? root : open;
}

/* First behaviour of a guard on the interval from the start to a neighbourhood of a place. */
static struct near_place near_zero(const struct pair_expansion *e, const struct pair_series *q, double suspect)
{
    for (double part = WIDEST; e->terms > 1 && part >= NARROWEST; part *= NARROWER) {
        struct bernstein whole;
        double left[PAIR_TERMS], low = suspect * (1.0 - part), high = smaller(suspect * (1.0 + part), e->reach);
        bernstein_of(e, q, 0, high, &whole);
        double *b = whole.b, noise = 2.0 * whole.noise;
        int64_t degree = whole.degree;
        cut(left, b, degree, low / high);
        int64_t shape = shape_of(b, degree, noise);
        if (shape == OPEN || !above(left, degree, noise, HALVINGS))
            continue;
        if (shape == VALLEY)
            return at_minimum(e, q, low, high);
        if (shape == FALLING && b[degree] < -noise) {
            struct near_place root = falling_root(e, q, (struct pair){sign_change(e, q, 0, low, high), 0.0});
            root.depth = -b[degree];
            return root;
        }
        double lowest = smaller(b[0], b[degree]);
        if (lowest > noise)
            return (struct near_place){RISING, {suspect, 0.0}, lowest, 0};
    }
    return e->terms > 1 ? flat_zero(e, q, suspect) : (struct near_place){.what = OPEN};
}

/* Taylor series of a mode in double-double, with running error bounds: its tape gone through operation by operation.
 *
 * The recurrences are those of henon_ref/taylor/rules.py. A coefficient is a pair and a bound of its error; sums of
 * products are compensated (Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26, 2005: the result is as if computed in twice
 * the precision, then rounded). Time is measured in a power of two of seconds, so that scaling is exact.
 */

/* Terms that a series has room for. */
#define PAIR_TERMS 96
/* Terms before which it does not end: some may be missing at first. */
#define FEWEST_TERMS 16
/* So many terms in a row that count for nothing end it. */
#define ENDING_TERMS 4
/* What counts for nothing, relative to the sum of all terms. */
#define NOTHING 0x1p-106

/* A series in a unit of time. */
struct pair_series {
    double high[PAIR_TERMS], low[PAIR_TERMS], error[PAIR_TERMS];
};

/* The series of a mode, from a point on. */
struct pair_expansion {
    const struct tape *tape;
    const double *constants;    /* of the tape: doubles, then what their rounding lost */
    struct pair_series *series; /* of each operation, then work space for as many */
    double unit;                /* s, a power of two */
    double reach;               /* in the unit: as far as the series have to hold */
    int64_t terms;              /* of each series */
    bool whole;                 /* whether there are no others */
    bool converged;             /* whether further ones count for nothing up to there */
};

static inline struct bounded term(const struct pair_series *series, int64_t k)
{
    return (struct bounded){series->high[k], series->low[k], series->error[k]};
}

static inline void put_term(struct pair_series *series, int64_t k, struct bounded number)
{
    series->high[k] = number.high, series->low[k] = number.low, series->error[k] = number.error;
}

static inline struct bounded exactly(double number)
{
    return (struct bounded){number, 0.0, 0.0};
}

/* A number of two doubles, each of which is the nearest one; exact where the second is zero. */
static inline struct bounded known_to(double high, double low, double relative)
{
    return (struct bounded){high, low, low == 0.0 ? 0.0 : relative * fabs(high)};
}

static inline struct bounded opposite(struct bounded a)
{
    return (struct bounded){-a.high, -a.low, a.error};
}

static inline struct bounded scaled_exactly(struct bounded a, double power_of_two)
{
    return (struct bounded){power_of_two * a.high, power_of_two * a.low, power_of_two * a.error};
}

/* A constant of the tape. */
static inline struct bounded constant(const struct pair_expansion *e, int64_t index)
{
    return known_to(e->constants[index], e->constants[e->tape->constants + index], ACCURATE);
}

/* The sum of a[j] b[k - j] for j from "first" to "last". */
static inline struct bounded convolution(const struct pair_series *a, const struct pair_series *b, int64_t k,
                                         int64_t first, int64_t last)
{
    double sum = 0.0, rest = 0.0, size = 0.0, error = 0.0;
    bool exact = true;
    for (int64_t j = first; j <= last; j++) {
        double p = a->high[j], q = b->high[k - j];
        struct pair product = pair_product(p, q), total = pair_sum(sum, product.high);
        double lows = fused(p, b->low[k - j], a->low[j] * q);
        sum = total.high;
        rest += total.low + (product.low + lows);
        size += fabs(product.high);
        error += fabs(p) * b->error[k - j] + a->error[j] * (fabs(q) + b->error[k - j]);
        exact = exact && product.low == 0.0 && total.low == 0.0 && lows == 0.0;
    }
    double count = (double)(last - first + 3);
    struct pair total = pair_sum(sum, rest);
    error = OUTWARDS * error + (exact ? 0.0 : 4.0 * count * count * 0x1p-106 * size);
    return (struct bounded){total.high, total.low, error};
}

static inline struct bounded over_integer(struct bounded a, int64_t k)
{
    return k == 1 ? a : quotient(a, exactly((double)k));
}

/* Terms of the sine's and the cosine's series, and of the exponential's, where the argument is small enough. */
#define SINE_TERMS 18
#define EXPONENTIAL_TERMS 17
/* Halvings of an argument before the exponential's series, and as many squares after it. */
#define EXPONENTIAL_HALVINGS 4

/* What is left of a number without the nearest multiple of a constant; the multiple. */
static inline struct bounded reduced(struct bounded a, struct bounded constant, double *multiple)
{
    *multiple = nearbyint(a.high / constant.high);
    return bounded_sum(a, opposite(bounded_product(exactly(*multiple), constant)));
}

static struct bounded exponential(struct bounded a)
{
    const struct bounded log_2 = {0x1.62e42fefa39efp-1, 0x1.abc9e3b39803fp-56, 0x1p-109};
    double multiple;
    struct bounded rest = scaled_exactly(reduced(a, log_2, &multiple), 1.0 / (1 << EXPONENTIAL_HALVINGS));
    struct bounded next = exactly(1.0), sum = next;
    if (!(fabs(multiple) < 1000.0))
        return exactly(INFINITY);
    for (int k = 1; k < EXPONENTIAL_TERMS; k++) {
        next = over_integer(bounded_product(next, rest), k);
        sum = bounded_sum(sum, next);
    }
    sum.error += fabs(next.high);
    for (int k = 0; k < EXPONENTIAL_HALVINGS; k++)
        sum = bounded_product(sum, sum);
    return scaled_exactly(sum, ldexp(1.0, (int)multiple));
}

/* Newton's step from the double's logarithm, whose error it squares. */
static struct bounded logarithm(struct bounded a)
{
    double about = log(a.high);
    struct bounded off = bounded_sum(bounded_product(a, exponential(exactly(-about))), exactly(-1.0));
    struct bounded half = scaled_exactly(bounded_product(off, off), 0.5);
    struct bounded found = bounded_sum(exactly(about), bounded_sum(off, opposite(half)));
    found.error += fabs(off.high * off.high * off.high);
    return found;
}

/* Sine, or cosine: that a quarter of a turn on. */
static struct bounded sine(struct bounded a, int64_t quarters)
{
    const struct bounded quarter = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54, 0x1p-108};
    double multiple;
    struct bounded rest = reduced(a, quarter, &multiple), square = opposite(bounded_product(rest, rest));
    if (!(fabs(multiple) < 0x1p50))
        return exactly(INFINITY);
    quarters = (quarters + (int64_t)multiple) & 3;
    struct bounded next = quarters & 1 ? exactly(1.0) : rest, sum = next;
    for (int k = quarters & 1 ? 1 : 2; k < 2 * SINE_TERMS; k += 2) {
        next = over_integer(bounded_product(next, square), k * (k + 1));
        sum = bounded_sum(sum, next);
    }
    sum.error += fabs(next.high);
    return quarters & 2 ? opposite(sum) : sum;
}

/* The first coefficient of a function; c: of a power its exponent. */
static struct bounded function_at(int64_t operation, struct bounded a, struct bounded c)
{
    switch (operation) {
    case TAPE_EXP:
        return exponential(a);
    case TAPE_LOG:
        return logarithm(a);
    case TAPE_POWER:
        return exponential(bounded_product(c, logarithm(a)));
    default:
        return sine(a, operation == TAPE_COS ? 1 : 0);
    }
}

/* Coefficient k of a function whose derivative has a factor: y' = sign a' factor, or y' factor = sign a'.
 *
 * "slopes": k times the coefficients of a, or of y.
 */
static inline struct bounded integral_term(const struct pair_expansion *e, const struct tape_operation *node,
                                           int64_t at, int64_t k)
{
    const struct pair_series *a = &e->series[node->first], *factor = &e->series[node->second];
    struct pair_series *slopes = &e->series[e->tape->operations + at];
    struct bounded sloped = bounded_product(exactly((double)(k * node->sign)), term(a, k));
    if (node->divides) {
        struct bounded known = convolution(slopes, factor, k, 1, k - 1);
        sloped = quotient(bounded_sum(sloped, opposite(known)), term(factor, 0));
        put_term(slopes, k, sloped);
        return over_integer(sloped, k);
    }
    put_term(slopes, k, sloped);
    return over_integer(convolution(slopes, factor, k, 1, k), k);
}

/* Coefficient k of a^c, whose derivative is c a' y / a. */
static inline struct bounded power_term(const struct pair_expansion *e, const struct tape_operation *node, int64_t at,
                                        int64_t k)
{
    struct bounded c = constant(e, node->constant);
    const struct pair_series *a = &e->series[node->first], *y = &e->series[at];
    struct bounded sum = exactly(0.0);
    for (int64_t j = 1; j <= k; j++) {
        struct bounded weight = bounded_sum(bounded_product(c, exactly((double)j)), exactly((double)(j - k)));
        sum = bounded_sum(sum, bounded_product(weight, bounded_product(term(a, j), term(y, k - j))));
    }
    return quotient(sum, bounded_product(exactly((double)k), term(a, 0)));
}

/* Coefficient k of an operation's series. */
static inline struct bounded next_term(const struct pair_expansion *e, struct bounded time, int64_t at, int64_t k)
{
    const struct tape_operation *node = &e->tape->operation[at];
    const struct pair_series *a = &e->series[node->first], *b = &e->series[node->second], *y = &e->series[at];
    switch (node->operation) {
    case TAPE_CONSTANT:
        return k == 0 ? constant(e, node->constant) : exactly(0.0);
    case TAPE_CLOCK:
        if (k == 0)
            return bounded_sum(constant(e, node->constant), bounded_product(constant(e, node->slope), time));
        return k == 1 ? scaled_exactly(constant(e, node->slope), e->unit) : exactly(0.0);
    case TAPE_ADD:
        return bounded_sum(term(a, k), term(b, k));
    case TAPE_SUB:
        return bounded_sum(term(a, k), opposite(term(b, k)));
    case TAPE_SCALE:
        return bounded_product(constant(e, node->constant), term(a, k));
    case TAPE_SHIFT:
        return k == 0 ? bounded_sum(term(a, 0), constant(e, node->constant)) : term(a, k);
    case TAPE_RSUB:
        return k == 0 ? bounded_sum(constant(e, node->constant), opposite(term(a, 0))) : opposite(term(a, k));
    case TAPE_MUL:
        return convolution(a, b, k, 0, k);
    case TAPE_DIV:
        return quotient(bounded_sum(term(a, k), opposite(convolution(y, b, k, 0, k - 1))), term(b, 0));
    case TAPE_RECIP:
        if (k == 0)
            return quotient(constant(e, node->constant), term(a, 0));
        return quotient(opposite(convolution(y, a, k, 0, k - 1)), term(a, 0));
    case TAPE_SQRT:
        if (k == 0)
            return bounded_root(term(a, 0));
        return quotient(bounded_sum(term(a, k), opposite(convolution(y, y, k, 1, k - 1))),
                        scaled_exactly(term(y, 0), 2.0));
    default:
        if (k == 0)
            return function_at(node->operation, term(a, 0),
                               node->operation == TAPE_POWER ? constant(e, node->constant) : exactly(0.0));
        return node->operation == TAPE_POWER ? power_term(e, node, at, k) : integral_term(e, node, at, k);
    }
}

/* Series of a state, or behind them of a guard. */
static inline struct pair_series *series_of(const struct pair_expansion *e, int64_t r)
{
    const struct tape *tape = e->tape;
    const int64_t *rows = (const int64_t *)(tape->operation + tape->operations);
    return &e->series[r < tape->states ? r : rows[r]];
}

/* Whether the last terms of the states and the guards count for nothing as far as the series have to hold. */
static bool ends_here(const struct pair_expansion *e, int64_t terms)
{
    for (int64_t r = 0; r < e->tape->states + e->tape->outputs; r++) {
        const double *c = series_of(e, r)->high;
        double total = 0.0, last = 0.0, power = 1.0;
        for (int64_t k = 0; k < terms; k++) {
            double size = fabs(c[k]) * power;
            total += size;
            last = k >= terms - ENDING_TERMS ? larger(last, size) : last;
            power *= e->reach;
        }
        if (!(last <= NOTHING * total && total < INFINITY))
            return false;
    }
    return true;
}

/* Fill the series, from a time and a state on, of "most" terms at most. */
static void expand_in_pairs(struct pair_expansion *e, struct bounded time, const struct bounded *state, int64_t most)
{
    const struct tape *tape = e->tape;
    const int64_t *field = (const int64_t *)(tape->operation + tape->operations);
    e->whole = e->converged = 0 < tape->degree && tape->degree < most;
    most = e->whole ? tape->degree + 1 : most;
    for (int64_t i = 0; i < tape->states; i++)
        put_term(&e->series[i], 0, state[i]);
    for (int64_t k = 0; k < most; k++) {
        for (int64_t at = tape->states; at < tape->operations; at++)
            put_term(&e->series[at], k, next_term(e, time, at, k));
        e->terms = k + 1;
        if (!e->whole && e->terms >= FEWEST_TERMS && e->terms % ENDING_TERMS == 0 && ends_here(e, e->terms)) {
            e->converged = true;
            return;
        }
        for (int64_t i = 0; i < tape->states && k + 1 < most; i++)
            put_term(&e->series[i], k + 1,
                     over_integer(scaled_exactly(term(&e->series[field[i]], k), e->unit), k + 1));
    }
}

/* What is left out of a series at a place, about. */
static inline double left_out(const struct pair_expansion *e, const struct pair_series *series)
{
    double size = 0.0, power = 1.0;
    for (int64_t k = 0; k < e->terms; k++) {
        size += fabs(series->high[k]) * power;
        power *= e->reach;
    }
    return e->whole ? 0.0 : 4.0 * NOTHING * size;
}

/* A series' value at a place in the unit, by Horner's rule. */
static struct bounded value_in_pairs(const struct pair_expansion *e, const struct pair_series *series,
                                     struct bounded place)
{
    struct bounded total = term(series, e->terms - 1);
    for (int64_t k = e->terms - 2; k >= 0; k--)
        total = bounded_sum(bounded_product(total, place), term(series, k));
    total.error += left_out(e, series);
    return total;
}

/* The same of its slope, in its unit. */
static struct bounded slope_in_pairs(const struct pair_expansion *e, const struct pair_series *series,
                                     struct bounded place)
{
    struct bounded total = exactly(0.0);
    for (int64_t k = e->terms - 1; k > 0; k--)
        total = bounded_sum(bounded_product(total, place), bounded_product(exactly((double)k), term(series, k)));
    total.error += (double)e->terms * left_out(e, series);
    return total;
}

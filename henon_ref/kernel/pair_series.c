/* Taylor series of a mode in double-double with running error bounds: its tape evaluated operation by operation.
 *
 * The recurrences are those of henon_ref/taylor/rules.py. A coefficient is a pair with an error bound; sums of products
 * are compensated (Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26, 2005: the result is as if computed in twice the
 * precision, then rounded). The unit of time is a power of two of seconds, so that scaling is exact.
 */

/* Capacity of a series, in terms. */
#define PAIR_TERMS 96
/* Smallest number of terms of a series: some of the first terms may be zero. */
#define FEWEST_TERMS 16
/* A series ends after this many consecutive negligible terms. */
#define ENDING_TERMS 4
/* A term is negligible below this part of the sum of all terms. */
#define NOTHING 0x1p-106

/* A Taylor series in a unit of time. */
struct pair_series {
    int64_t degree; /* later terms are zero */
    double high[PAIR_TERMS], low[PAIR_TERMS], error[PAIR_TERMS];
};

/* Taylor series of a mode from a point on. */
struct pair_expansion {
    const struct tape *tape;
    const double *constants;    /* of the tape: doubles, then what their rounding lost */
    struct pair_series *series; /* of each operation, then work space of the same size */
    double unit;                /* s, a power of two */
    double reach;               /* length on which the series must hold, in the unit */
    int64_t terms;              /* number of terms of each series */
    bool whole;                 /* whether all later terms are zero */
    bool converged;             /* whether later terms are negligible within the reach */
};

static inline struct bounded term(const struct pair_series *series, int64_t k)
{
    return (struct bounded){series->high[k], series->low[k], series->error[k]};
}

static inline void put_term(struct pair_series *series, int64_t k, struct bounded number)
{
    series->high[k] = number.high, series->low[k] = number.low, series->error[k] = number.error;
}

/* A constant of the tape. */
static inline struct bounded constant(const struct pair_expansion *e, int64_t index)
{
    return known_to(e->constants[index], e->constants[e->tape->constants + index], ACCURATE);
}

/* A sum of products: sums of the leading doubles, of the rests, and of the sizes of both, and an error bound. */
struct product_sum {
    double sum, rest, size, rest_size, error;
};

static inline void add_product(struct product_sum *s, double p, double p_low, double p_error, double q, double q_low,
                               double q_error)
{
    struct pair product = pair_product(p, q), total = pair_sum(s->sum, product.high);
    double lost = total.low + (product.low + fused(p, q_low, p_low * q));
    s->sum = total.high;
    s->rest += lost;
    s->size += fabs(product.high);
    s->rest_size += fabs(lost);
    s->error += fabs(p) * q_error + p_error * (fabs(q) + q_error);
}

/* The value of a sum of "count" products, with its error bound. */
static inline struct bounded summed(const struct product_sum *s, int64_t count)
{
    struct pair total = pair_sum(s->sum, s->rest);
    double rounding = (double)(count + 4) * EPS * s->rest_size + (s->rest_size > 0.0 ? 8.0 * EPS * EPS * s->size : 0.0);
    return (struct bounded){total.high, total.low, OUTWARDS * (s->error + rounding)};
}

/* Sum of a[j] b[k - j] for j from "first" to "last". */
static inline struct bounded convolution(const struct pair_series *a, const struct pair_series *b, int64_t k,
                                         int64_t first, int64_t last)
{
    struct product_sum s = {0.0, 0.0, 0.0, 0.0, 0.0};
    first = k - b->degree > first ? k - b->degree : first;
    last = least(last, a->degree);
    for (int64_t j = first; j <= last; j++)
        add_product(&s, a->high[j], a->low[j], a->error[j], b->high[k - j], b->low[k - j], b->error[k - j]);
    return summed(&s, last - first + 1);
}

/* Coefficient k of a function y with y' = sign a' factor, or y' factor = sign a' if the node "divides".
 *
 * "slopes": k times coefficient k, of a or of y.
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
    slopes->degree = a->degree;
    return over_integer(convolution(slopes, factor, k, 1, k), k);
}

/* Coefficient k of y = a^c, from y' = c a' y / a. */
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

/* Series of state r, or of guard r - n. */
static inline struct pair_series *series_of(const struct pair_expansion *e, int64_t r)
{
    const struct tape *tape = e->tape;
    const int64_t *rows = (const int64_t *)(tape->operation + tape->operations);
    return &e->series[r < tape->states ? r : rows[r]];
}

/* Convergence of a row's series: the sum of the sizes of its terms, and the number of consecutive negligible terms. */
struct convergence {
    double total;
    int64_t quiet;
};

/* Check whether the last terms of all states and guards are negligible; "power" is reach^k. */
static bool ends_here(const struct pair_expansion *e, struct convergence *rows, int64_t k, double power)
{
    bool found = k + 1 >= FEWEST_TERMS;
    for (int64_t r = 0; r < e->tape->states + e->tape->outputs; r++) {
        double size = fabs(series_of(e, r)->high[k]) * power;
        rows[r].total += size;
        rows[r].quiet = size <= NOTHING * rows[r].total ? rows[r].quiet + 1 : 0;
        found = found && rows[r].quiet >= ENDING_TERMS && rows[r].total < INFINITY;
    }
    return found;
}

/* Compute the series from a time and a state on, with at most "most" terms. */
static void expand_in_pairs(struct pair_expansion *e, struct bounded time, const struct bounded *state, int64_t most)
{
    const struct tape *tape = e->tape;
    const int64_t *field = (const int64_t *)(tape->operation + tape->operations);
    struct convergence rows[PAIR_ROWS] = {{0.0, 0}};
    double power = 1.0;
    e->whole = e->converged = 0 < tape->degree && tape->degree < most;
    most = e->whole ? tape->degree + 1 : most;
    for (int64_t at = 0; at < tape->operations; at++) {
        e->series[at].degree = tape->operation[at].degree;
        e->series[tape->operations + at].degree = PAIR_TERMS;
    }
    for (int64_t i = 0; i < tape->states; i++)
        put_term(&e->series[i], 0, state[i]);
    for (int64_t k = 0; k < most; k++) {
        for (int64_t at = tape->states; at < tape->operations; at++)
            put_term(&e->series[at], k, next_term(e, time, at, k));
        e->terms = k + 1;
        if (!e->whole && ends_here(e, rows, k, power)) {
            e->converged = true;
            return;
        }
        power *= e->reach;
        for (int64_t i = 0; i < tape->states && k + 1 < most; i++)
            put_term(&e->series[i], k + 1,
                     over_integer(scaled_exactly(term(&e->series[field[i]], k), e->unit), k + 1));
    }
}

/* Powers at^k of a place within the reach; and their derivatives k at^(k - 1). */
struct powers {
    struct pair_series own, sloped;
};

static void powers_at(const struct pair_expansion *e, struct pair place, struct powers *powers)
{
    struct bounded at = {place.high, place.low, 0.0}, power = exactly(1.0);
    put_term(&powers->sloped, 0, exactly(0.0));
    for (int64_t k = 0; k < e->terms; k++) {
        put_term(&powers->own, k, power);
        if (k + 1 < e->terms)
            put_term(&powers->sloped, k + 1, bounded_product(exactly((double)(k + 1)), power));
        power = bounded_product(power, at);
    }
}

/* Value of a series at a place, from the place's powers; or its slope in the unit, from their derivatives. */
static inline struct bounded value_in_pairs(const struct pair_expansion *e, const struct pair_series *series,
                                            const struct pair_series *powers)
{
    struct product_sum s = {0.0, 0.0, 0.0, 0.0, 0.0};
    for (int64_t k = e->terms - 1; k >= 0; k--)
        add_product(&s, series->high[k], series->low[k], series->error[k], powers->high[k], powers->low[k],
                    powers->error[k]);
    if (!e->whole) /* the truncated terms */
        s.error += 4.0 * NOTHING * (double)e->terms * s.size;
    return summed(&s, e->terms);
}

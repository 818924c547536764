/* Step-size control: the length at which the last two terms of a Taylor expansion fall below the tolerance.
 *
 * With coefficients c_k and order p, theta = min over k of p - 1 and p of (tolerance size / |c_k|)^(1/k), where size is
 * |c_0| + |c_1| theta + |c_2| theta^2 of the same row; iterated while theta shrinks to less than half (Jorba and Zou,
 * Exp. Math. 14, 2005, Sec. 3). The unit of time of the coefficients is kept near the step, so that its powers stay
 * within the range of doubles; coefficients that are not finite shorten the unit.
 */

/* Step, in the unit, if no coefficient limits it. */
#define UNLIMITED 1e30
/* Last terms that are smaller than the terms before them by this factor are a gap, not a decreasing tail. */
#define GAP_RATIO 1e-5
/* A step longer than the last one by 1 + HIDDEN_GROWTH/order may have hidden terms: its error is 100 times as large. */
#define HIDDEN_GROWTH 5.0

/* (above / below) ^ power to about one part in 100, which is enough for a step size. Both numbers are positive.
 *
 * The bits of a double, read as an integer, are a piecewise linear logarithm to base 2.
 */
static inline double rough_root(double above, double below, double power)
{
    double exponent = (double)(bits(above) - bits(below)) * (EPS * power);
    double shifted = exponent + 0x1.8p52; /* rounds to a whole number, kept in the low bits */
    double part = exponent - (shifted - 0x1.8p52);
    double whole = from_bits(((uint64_t)bits(shifted) + 1023) << 52);
    return whole * (1.0 + part * (0.6931471805599453 + 0.24022650695910072 * part));
}

/* Check whether a state leaves zero by a power of time higher than two: no coefficient tells its size on a step. */
static inline bool without_size(const double *row)
{
    return row[0] == 0.0 && row[1] == 0.0 && row[2] == 0.0;
}

static inline bool some_without_size(const struct work *w, const double *c)
{
    bool found = false;
    for (int64_t r = 0; r < w->run->states; r++)
        found = found || without_size(c + r * w->width);
    return found;
}

/* Largest relative sizes of the last two coefficients, over all rows of an expansion, on a step of theta units.
 *
 * States without a size limit no step; it is validated at the start and after an event (may_hide_terms), where a state
 * may be exactly zero.
 */
static inline void error_norms(const struct work *w, const double *c, int64_t rows, double theta, double *last,
                               double *before)
{
    int64_t order = w->run->order;
    *last = *before = 0.0;
    for (int64_t r = 0; r < rows; r++) {
        const double *row = c + r * w->width;
        double scale = fused(theta, fused(theta, fabs(row[2]), fabs(row[1])), fabs(row[0])) + 1e-300;
        if (r < w->run->states && without_size(row))
            continue;
        *last = larger(*last, fabs(row[order]) / scale);
        *before = larger(*before, fabs(row[order - 1]) / scale);
    }
}

/* Check whether a coefficient up to a degree > 0 is infinite or not a number: the unit is too long, or no unit helps.
 *
 * If this is a coefficient of order 2 at most, the unit is at least 1e100 times too long for these coefficients,
 * because states are bounded (BLOWN_UP).
 */
static bool infinite(const struct work *w, int64_t rows, int64_t degree)
{
    bool found = false;
    for (int64_t r = 0; r < (degree > 0 ? rows : 0); r++)
        for (int64_t k = 0; k <= degree; k++)
            found = found || !(fabs(row_of(w, r)[k]) < INFINITY);
    return found;
}

/* Step, in the unit, at which the last two terms of an expansion fall below the tolerance (Jorba and Zou 2005, Sec. 3).
 *
 * 0 if a coefficient is not finite. The expansion writes four norms after its rows: the largest relative sizes of
 * coefficients p and p - 1 on a step of one unit; a sum that is not finite if a coefficient is not; and the longest
 * step that exponentials and denominators allow.
 */
static inline double step_size(const struct work *w, const double *c, int64_t rows)
{
    const double *norms = c + rows * w->width, tolerance = w->run->tolerance;
    double last = norms[0], before = norms[1], theta = 1.0, longest = smaller(norms[3], UNLIMITED);
    double power = 1.0 / (double)w->run->order, other = 1.0 / (double)(w->run->order - 1);
    if (!(norms[2] < INFINITY))
        return 0.0;
    if (larger(last, before) > 1.0 && some_without_size(w, c)) /* otherwise the unit is near the step */
        error_norms(w, c, rows, theta, &last, &before);
    for (int step = 0; step < 4; step++) {
        double new = UNLIMITED;
        if (last > 0.0)
            new = smaller(new, rough_root(tolerance, last, power));
        if (before > 0.0)
            new = smaller(new, rough_root(tolerance, before, other));
        if (new >= 0.5 * theta)
            return smaller(new, longest);
        theta = new;
        error_norms(w, c, rows, theta, &last, &before);
    }
    return smaller(theta, longest);
}

/* Bound the rounding of the slopes' own operations where a step begins ("own_rounding"). Mark guards as faint, so that
 * they limit no step, if their coefficients are only rounding of theirs. */
static void account_for_rounding(const struct work *w)
{
    const struct run *run = w->run;
    int64_t n = run->states;
    w->mode->rounding(run->time, run->time_low, OWN_ROUNDING, w->x, w->constants, w->ahead);
    for (int64_t i = 0; i < n; i++)
        w->own_rounding[i] = w->ahead[i] < INFINITY ? run->unit * w->ahead[i] : 0.0;
    for (int64_t g = 0; g < w->mode->guards; g++) {
        const double *row = guard_row(w, g);
        double size = fabs(row[0]) + fabs(row[1]) + fabs(row[2]);
        w->faint[g] = w->ahead[n + g] > NO_ACCOUNT && size <= w->ahead[n + g] ? 1 : 0;
    }
}

/* step_size for guards that have more than two zeros, or are only rounding: the size of such a guard is taken from its
 * terms after the known zeros and after terms that are zero, and is at least the rounding of its own operations. */
static double flat_step_size(const struct work *w, int64_t rows)
{
    const struct run *run = w->run;
    int64_t n = run->states, order = run->order;
    double shortest = smaller(row_of(w, rows)[3], UNLIMITED);
    w->mode->rounding(run->time, run->time_low, OWN_ROUNDING, w->x, w->constants, w->ahead);
    for (int64_t r = 0; r < rows; r++) {
        const double *row = row_of(w, r);
        int64_t first = r >= n ? w->known_zeros[r - n] : 0;
        if (r < n && without_size(row))
            continue;
        while (r >= n && row[first] == 0.0 && first < order - 4)
            first += 1;
        double theta = 1.0, least = r >= n && w->ahead[r] < INFINITY ? w->ahead[r] : 0.0;
        for (int step = 0; step < 4; step++) {
            double size = fabs(row[first]) + theta * (fabs(row[first + 1]) + theta * fabs(row[first + 2]));
            double new = UNLIMITED;
            size = larger(size * whole_power(theta, first), least) + 1e-300;
            for (int64_t k = order - 1; k <= order; k++)
                if (row[k] != 0.0)
                    new = smaller(new, pow(run->tolerance * size / fabs(row[k]), 1.0 / (double)k));
            bool enough = new >= 0.5 * theta;
            theta = new;
            if (enough)
                break;
        }
        shortest = smaller(shortest, theta);
    }
    return shortest;
}

/* Sum of |c_k| theta^j over k >= first, where j = k - first. */
static double size_of_terms(const double *row, int64_t first, int64_t order, double theta)
{
    double size = 0.0, power = 1.0;
    for (int64_t k = first; k <= order; k++) {
        size += fabs(row[k]) * power;
        power *= theta;
    }
    return size;
}

/* Check whether series may have hidden terms (has_hidden_terms in validation.c): at the start and after an event, where
 * a state may be symmetric or a forcing may begin, and where the proposed step is longer than the last one. */
static inline bool may_hide_terms(const struct work *w, double step, double last)
{
    const struct run *run = w->run;
    bool first = run->steps == 0 || run->time == run->event_time;
    bool longer = (step - last) * (double)run->order > HIDDEN_GROWTH * last;
    return w->mode->polynomial_degree == 0 && (first || longer);
}

/* Length, at most one unit, on which the terms of the expansion ahead decrease; 0 if a coefficient is not finite. */
static double length_ahead(const struct work *w, int64_t rows)
{
    return smaller(step_size(w, w->ahead, rows), 1.0);
}

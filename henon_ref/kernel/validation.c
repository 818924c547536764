/* Step validation: check whether the Taylor polynomial represents the solution on the whole step.
 *
 * The step size relies on two terms; the validation examines all of them. Terms must decrease towards the last ones.
 * They must not vanish all at once (a gap does not bound the terms after it), nor cancel by more digits than double
 * precision can spare. Terms hidden behind the last ones show in the slopes at the step's end. Next to a branch point
 * of an operation (sqrt, power, asin) the step ends before the radius of convergence. A step that fails is shortened.
 * This is a heuristic of the reference alone; proofs bound the tails (henon_ref/enclosure/tail_bounds.py).
 */

/* Smallest factor by which a refused step is shortened; above it 0.95 worst^(-1/p), for an error that goes as
 * theta^p. */
#define QUARTER 0.25
/* A step shorter than the last one by this factor is accepted although guards differ from their prediction. */
#define LEAST_PART (1.0 / 64.0)
/* If slopes, or guards with branch points, differ from their prediction, a step is accepted only below this part of the
 * unit, or if it is too short to move the compensated time and all values are finite. So steps end before a kink or a
 * singularity. */
#define SHORTEST_PART 1e-60
/* Relative error of a slope at which expansions agree. */
#define AGREEMENT 1e-6
/* The smallest relative error that is required of guards, and where there are branch points. */
#define CLOSEST_AGREEMENT 1e-10
/* Error of a step's end, in tolerances, below which its series has no hidden terms. */
#define HIDDEN 4.0
/* Rounding error of a guard, as a multiple of the difference of its values at neighbouring points. */
#define SPREAD 8.0

/* Estimate the rounding error of each state's slope and of each guard at "point" and time "end"; written to "change".
 *
 * The error is at least the bound of the own operations, except of guards with branch points. "neighbours": the values
 * at two neighbours are compared, too, whose states differ by a few units in the last place, in one direction and in
 * alternating ones: no number of terms predicts how the root of an argument next to zero amplifies rounding. "ahead",
 * the expansion of the point by "code", is restored.
 */
static void measure_rounding(struct work *w, expand_code code, struct pair end, bool neighbours)
{
    struct run *run = w->run;
    int64_t n = run->states, rows = n + w->mode->guards;
    double *rounding = w->change, *point = w->point;
    w->changed_by = -1.0;
    w->mode->rounding(end.high, end.low, OWN_ROUNDING, point, w->constants, rounding);
    for (int64_t r = 0; r < rows; r++) {
        bool smooth = r < n || w->mode->guard[r - n].branches == 0;
        rounding[r] = smooth && rounding[r] < INFINITY ? (r < n ? run->unit : 1.0) * rounding[r] : 0.0;
    }
    if (!neighbours)
        return;
    for (int64_t r = 0; r < rows; r++) {
        double *row = row_ahead(w, r);
        row[2] = row[r < n ? 1 : 0];
        if (r < n)
            row[3] = point[r];
    }
    for (int neighbour = 0; neighbour < 2; neighbour++) {
        for (int64_t i = 0; i < n; i++)
            point[i] += (neighbour == 0 || i % 2 == 0 ? 2.0 : -2.0) * EPS * point[i];
        w->mode->slopes(end.high, end.low, run->unit, point, w->constants, w->ahead);
        for (int64_t r = 0; r < rows; r++) {
            const double *row = row_ahead(w, r);
            rounding[r] = larger(rounding[r], SPREAD * fabs(row[r < n ? 1 : 0] - row[2]));
            if (r < n)
                point[r] = row[3];
        }
    }
    code(end.high, end.low, run->unit, point, w->constants, w->ahead);
    run->expansions += 3;
}

/* Agreement of an expansion with a new one at a place on its step. */
struct agreement {
    bool agrees;    /* all rows that are compared agree */
    bool kept;      /* all of them except guards without branch points */
    double worst;   /* largest error, as a multiple of the allowed one */
    double shorter; /* step on which the terms of the rows that disagree decrease */
    double longest; /* longest step so far at whose end no prediction is far off */
};

/* Error of a slope, as a part of its state's size over the step, or of a guard, below which no terms are hidden. */
static inline double hidden_part(const struct work *w, bool guard)
{
    double part = HIDDEN * (double)w->run->order * larger(w->run->tolerance, EPS);
    if (guard || w->mode->branches)
        part = larger(part, CLOSEST_AGREEMENT);
    return w->mode->branches ? smaller(part, AGREEMENT) : part;
}

/* Sum of row[k] weights[k] over k <= order, as four sums. */
static inline double weighted_sum(const double *row, const double *weights, int64_t order)
{
    double sums[4] = {0.0};
    int64_t k = 0;
    for (; k + 3 <= order; k += 4)
        for (int lane = 0; lane < 4; lane++)
            sums[lane] += row[k + lane] * weights[k + lane];
    for (; k <= order; k++)
        sums[0] += row[k] * weights[k];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/* Value of a row's series at a place on the step (first = 0), or slope of a state (first = 1); adds the terms' sizes to
 * "size". */
static inline double predicted_at(const double *row, int64_t order, int64_t first, double at, double *size)
{
    double predicted = 0.0, power = 1.0;
    for (int64_t k = first; k <= order; k++) {
        double term = row[k] * power * (double)(first == 1 ? k : 1);
        predicted += term;
        *size += fabs(term);
        power *= at;
    }
    return predicted;
}

/* Largest change of a state without a size on longer steps that were compared, per length "at" of the present step.
 *
 * Its power of time may be higher than the order; then the relative error of its slope is 1 on every short step. 0 for
 * other states, and if the step is longer than a quarter of the longest one.
 */
static inline double reached(const struct work *w, int64_t state, double slope, double at, double longest)
{
    if (!without_size(row_of(w, state)))
        return 0.0;
    w->speeds[state] = larger(w->speeds[state], at * fabs(slope));
    return at <= QUARTER * longest ? w->speeds[state] / at : 0.0;
}

/* Compare the expansion with a new one made at a place on the step.
 *
 * "slopes": code that computes only slopes and values, or null. "decreasing": all terms decrease, so that guards
 * without branch points need no comparison. The step is "theta" units long. "hidden": compare to HIDDEN tolerances,
 * otherwise to the part AGREEMENT of the terms' sizes.
 */
static void compare_at(struct work *w, double at, double theta, expand_code slopes, bool decreasing,
                       bool hidden, struct agreement *found)
{
    struct run *run = w->run;
    int64_t n = run->states, guards = w->mode->guards, order = run->order;
    struct pair end = time_after(run, at * run->unit);
    expand_code code = slopes ? slopes : w->mode->expansion;
    change_over(w, at);
    for (int64_t i = 0; i < n; i++)
        w->point[i] = w->x[i] + w->change[i];
    code(end.high, end.low, run->unit, w->point, w->constants, w->ahead);
    run->expansions += 1;
    /* In the new expansion exponentials and denominators must allow a quarter of the step (taylor/llvm/step.py). */
    found->agrees = found->agrees && (slopes || row_ahead(w, n + guards)[3] >= 0.25 * at);
    bool branches = w->mode->branches != 0; /* next to a branch point no slope is excused by its rounding error */
    bool near = true; /* no prediction is far off */
    int measured = 0; /* 1: rounding of the slopes; 2: also that of the states */
    for (int64_t r = 0; r < n + guards; r++) {
        if (r >= n && w->faint[r - n] != 0)
            continue;
        bool smooth = r >= n && w->mode->guard[r - n].branches == 0;
        if (smooth && decreasing)
            continue;
        int64_t first = r < n ? 1 : 0; /* slopes of states, values of guards */
        double there = row_ahead(w, r)[first], size = fabs(there);
        double off = fabs(predicted_at(row_of(w, r), order, first, at, &size) - there), terms = size - fabs(there);
        if (hidden && !branches) /* an error of the slope is one of the state over the step, as in the step size */
            size = larger(size, size_of_terms(row_of(w, r), 0, 2, at) / (first == 1 ? at : 1.0));
        if (r < n)
            size = larger(size, reached(w, r, there, at, found->longest));
        /* A slope that moves its state by no more than rounding over the step, or is no larger than the rounding of its
         * operations (1 - exp(-t^8) before t = 0.01), counts as zero, whatever its digits. */
        double part = hidden ? hidden_part(w, r >= n) : AGREEMENT;
        double least = r < n ? larger(4.0 * EPS * fabs(w->x[r]) / at, w->own_rounding[r]) : 0.0;
        double allowed = larger(part * size, least);
        if ((!branches || r >= n) && off > allowed) { /* next to zero a guard is mostly rounding */
            int wanted = hidden || branches || r >= n ? 2 : 1;
            if (measured < wanted) {
                measure_rounding(w, code, end, wanted == 2);
                measured = wanted;
            }
            allowed = larger(allowed, w->change[r]);
        }
        if (!(off <= allowed)) {
            near = near && off < INFINITY && !(terms > 2.0 * fabs(there) && off > 0.5 * terms);
            found->worst = off < INFINITY ? larger(found->worst, off / allowed) : INFINITY;
            found->agrees = false, found->kept = found->kept && smooth;
            while (found->shorter > LEAST_PART * theta
                   && tail_of(w, r, found->shorter, 0.0) == NOT_DECREASING)
                found->shorter *= SHORTER;
        }
    }
    if (near)
        found->longest = larger(found->longest, at);
    else
        memset(w->speeds, 0, (size_t)n * sizeof(double));
}

/* Check whether terms after the last ones move the end of a step by several tolerances: "hidden" terms.
 *
 * The last two terms bound later ones only if no term between is small by symmetry. The series of a pendulum released
 * at a right angle has only every fourth coefficient, that of cos(t^5) - x at t = 0 those of exp(-t), which decrease,
 * and every tenth. Hidden terms are in the slopes at the step's end, but not in the polynomial's.
 */
static bool has_hidden_terms(struct work *w, double theta)
{
    struct run *run = w->run;
    int64_t n = run->states, guards = w->mode->guards, order = run->order;
    struct pair end = time_after(run, theta * run->unit);
    change_over(w, theta);
    for (int64_t i = 0; i < n; i++)
        w->point[i] = w->x[i] + w->change[i];
    w->mode->slopes(end.high, end.low, run->unit, w->point, w->constants, w->ahead);
    run->expansions += 1;
    double *powers = w->powers, *slopes = w->scaled; /* theta^k; k theta^k */
    powers_of(theta, powers, order);
    for (int k = 0; k <= (int)order; k++)
        slopes[k] = k * powers[k];
    bool clear = true;
    for (int64_t r = 0; r < n + guards; r++) {
        const double *row = row_of(w, r), *there = row_ahead(w, r);
        double off = r < n ? weighted_sum(row, slopes, order) - theta * there[1]
                           : weighted_sum(row, powers, order) - there[0];
        clear = clear && fabs(off) <= hidden_part(w, r >= n) * size_of_terms(row, 0, 2, theta);
    }
    if (clear) /* most steps */
        return false;
    struct agreement found = {.agrees = true, .kept = true, .worst = 1.0, .shorter = theta};
    account_for_rounding(w);
    memset(w->speeds, 0, (size_t)n * sizeof(double));
    compare_at(w, theta, theta, w->mode->slopes, false, true, &found);
    return !found.agrees;
}

/* Longest step, theta at most, on which the expansion holds.
 *
 * "unconverged": the terms are examined first. While they grow the step is shortened until they decrease, so that it
 * ends within their circle of convergence. Terms that are zero or end in a gap do not prove convergence (those of a
 * high power where it is flat), nor do terms below rounding if the step is much longer than the last one ("grown").
 * No terms do if there are hidden ones.
 *
 * Then the expansion is compared with new ones, at the end of the step and within it, if some terms do not prove
 * convergence, or if the field or a guard has branch points ("branches"). Beyond a branch point the series of
 * a square root continues as if there were none (its terms may decrease, or it may be a polynomial). If slopes of
 * states or values of guards differ from their prediction, the step is shortened and compared again. Guards without
 * branch points are not compared if all terms decrease, and on a step much shorter than the last one their differences
 * are ignored, because rounding alone may change a guard next to zero.
 */
static double validated_step(struct work *w, double theta, bool grown, bool unconverged)
{
    const struct run *run = w->run;
    int64_t rows = run->states + w->mode->guards, order = run->order;
    bool decreasing = true, hidden = w->hidden;
    double proposed = theta;
    account_for_rounding(w);
    for (int64_t r = 0; r < (unconverged ? rows : 0); r++) {
        if (r >= run->states && w->faint[r - run->states] != 0)
            continue;
        enum tail tail = tail_of(w, r, theta, grown || w->hidden ? 0.0 : EPS);
        if (tail == NOT_DECREASING) {
            while (tail_of(w, r, theta, EPS) == NOT_DECREASING)
                theta *= SHORTER;
            tail = tail_of(w, r, theta, 0.0);
        }
        decreasing = decreasing && tail == DECREASING;
    }
    if (hidden && theta < proposed)
        hidden = has_hidden_terms(w, theta);
    decreasing = decreasing && !hidden;
    expand_code slopes = decreasing && w->mode->branches ? w->mode->slopes : NULL;
    bool checking = !decreasing || slopes;
    memset(w->speeds, 0, (size_t)run->states * sizeof(double));
    double longest = 0.0;
    while (checking) {
        struct agreement found = {.agrees = true, .kept = true, .worst = 1.0, .shorter = theta, .longest = longest};
        compare_at(w, theta, theta, slopes, decreasing, hidden, &found);
        if (found.kept)
            compare_at(w, 0.37 * theta, theta, slopes, decreasing, hidden, &found);
        if (found.agrees)
            break;
        longest = found.longest;
        bool falls = LEAST_PART * theta < found.shorter && found.shorter < theta;
        if (falls && found.kept)
            return found.shorter;
        bool finite = found.worst < INFINITY;
        theta *= finite ? larger(QUARTER, 0.95 * pow(found.worst, -1.0 / (double)order)) : SHORTER;
        theta = falls ? smaller(theta, found.shorter) : theta;
        bool nowhere = theta <= SHORTEST_PART || (finite && below_compensated_resolution(run, theta * run->unit));
        bool enough = found.kept ? theta <= LEAST_PART : nowhere;
        checking = !enough || tail_unconverged(w, rows, theta);
    }
    return theta;
}

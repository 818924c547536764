/* Step validation: does the Taylor polynomial stand for the solution on the whole step?
 *
 * The step size trusts two terms. Here all are looked at: terms must fall towards the last ones, not vanish all at once
 * (a gap says nothing of what follows), nor cancel by more digits than double precision has to spare; next to a branch
 * point of an operation (sqrt, power, asin) the step ends before its radius of convergence. A step that fails is made
 * shorter. This is a heuristic of the reference alone; proofs bound the tails (henon_ref/enclosure/tail_bounds.py).
 */

/* Terms this much smaller than those before them are no tail but a gap. */
#define GAP_RATIO 1e-5
/* Factor by which a step is shortened at a time while terms grow; and the largest ratio of the last two terms of a
 * step that needs no closer look. */
#define SHORTER 0.7
/* Least factor for a step that is refused; above it 0.95 worst^(-1/p), for an error that goes as theta^p. */
#define QUARTER 0.25
/* Terms that fall by less than this over two orders have not converged. */
#define SLOW 0.5
/* A step this much shorter than the last one is accepted though guards are not what was predicted. */
#define LEAST_PART (1.0 / 64.0)
/* Where slopes, or guards with branch points, disagree: part of the unit below which a step is accepted all the same.
 * So is one too short to move the compensated time, if all is finite. So steps end before a kink or a singularity. */
#define SHORTEST_PART 1e-60
/* What rounding may cost a row of a polynomial at least, of its size on a step. */
#define ROUNDING (1e3 * EPS)
/* A guard may be off by this multiple of the difference of its values at neighbouring points. */
#define SPREAD 8.0
/* Places on a step at which the size of a row is sampled. */
#define SIZE_POINTS 4

/* What the last terms of a step do (tail_shape). */
enum tail { DECREASING, NOT_DECREASING, ENDS_IN_GAP };

/* A step no longer than where terms of a polynomial cancel by more digits than there are to spare.
 *
 * No coefficient limits a step where a motion is a polynomial by its form.
 */
static double cancellation_limit(const struct work *w, int64_t rows, double theta)
{
    int64_t degree = w->mode->polynomial_degree;
    double spare = larger(w->run->tolerance, ROUNDING) / EPS;
    for (int64_t r = 0; r < rows; r++) {
        const double *row = row_of(w, r);
        while (true) {
            double terms = 0.0, size = 0.0;
            for (int64_t k = degree; k >= 0; k--)
                terms = terms * theta + fabs(row[k]);
            for (int point = 1; point <= SIZE_POINTS; point++) {
                double at = theta * point / SIZE_POINTS, height = 0.0;
                for (int64_t k = degree; k >= 0; k--)
                    height = height * at + row[k];
                size = larger(size, fabs(height));
            }
            if (!(terms > spare * size))
                break;
            theta *= 0.5;
        }
    }
    return theta;
}

/* What the last terms of a row do on a step.
 *
 * With T_k = |c_k| theta^k, m = p/2 - 1, half = max T_m..T_(m+3), before = max(T_(p-3), T_(p-2)), end =
 * max(T_(p-1), T_p): DECREASING if GAP_RATIO before < end < SLOW min(half, before). All are over theta^m below.
 *
 * NOT_DECREASING: the last two are not much smaller than those before them or halfway to them; what comes after may be
 * larger still (a singularity on the step, a high power whose turn comes later). ENDS_IN_GAP: they are next to nothing
 * all at once; a gap tells nothing of what comes after. Where they are below "least_part" > 0 of the row's size they
 * may do what they like.
 */
static enum tail tail_shape(const double *row, int64_t order, double theta, double least_part)
{
    int64_t middle = order / 2 - 1, last = order - 3;
    double square = theta * theta, cube = square * theta, shift = 1.0;
    for (int64_t k = middle; k < last; k++) /* a call of the C library costs as much as the rest */
        shift *= theta;
    double half = larger(larger(fabs(row[middle]), fabs(row[middle + 1]) * theta),
                         larger(fabs(row[middle + 2]) * square, fabs(row[middle + 3]) * cube));
    double before = shift * larger(fabs(row[last]), fabs(row[last + 1]) * theta);
    double end = shift * larger(fabs(row[last + 2]) * square, fabs(row[last + 3]) * cube);
    if (GAP_RATIO * before < end && end < SLOW * smaller(half, before))
        return DECREASING;
    double scale = least_part * (fabs(row[0]) + theta * (fabs(row[1]) + theta * fabs(row[2])));
    for (int64_t k = 0; k < middle; k++)
        scale /= theta;
    if (least_part > 0.0 && larger(end, before) <= scale)
        return DECREASING;
    return end <= GAP_RATIO * before ? ENDS_IN_GAP : NOT_DECREASING;
}

/* Whether the terms of some row do not fall towards the last ones as those of a series do that has converged. */
static inline bool tail_unconverged(const struct work *w, int64_t rows, double theta)
{
    const double *norms = row_of(w, rows);
    if (norms[0] * theta <= SHORTER * norms[1]) /* the usual case */
        return false;
    bool found = false;
    for (int64_t r = 0; r < rows; r++)
        found = found || tail_shape(row_of(w, r), w->run->order, theta, EPS) != DECREASING;
    return found;
}

/* What rounding may cost the value of each guard at a point, behind the states in "change".
 *
 * By values at two neighbours, each state a few units in its last place away, in one direction and in alternating ones:
 * what a root's argument next to zero makes of rounding no number of terms foretells. "ahead", the expansion of the
 * point by "code" at time "end", stays as it is.
 */
static void guard_rounding(const struct work *w, expand_code code, double end)
{
    struct run *run = w->run;
    int64_t n = run->states, guards = w->mode->guards;
    double *rounding = w->change + n, *point = w->point;
    for (int64_t g = 0; g < guards; g++) {
        double *row = row_ahead(w, n + g);
        rounding[g] = 0.0, row[2] = row[0];
    }
    for (int neighbour = 0; neighbour < 2; neighbour++) {
        for (int64_t i = 0; i < n; i++) {
            w->change[i] = point[i];
            point[i] += (neighbour == 0 || i % 2 == 0 ? 2.0 : -2.0) * EPS * point[i];
        }
        w->mode->slopes(end, run->time_low, run->unit, point, w->constants, w->ahead);
        for (int64_t i = 0; i < n; i++)
            point[i] = w->change[i];
        for (int64_t g = 0; g < guards; g++) {
            const double *row = row_ahead(w, n + g);
            rounding[g] = larger(rounding[g], SPREAD * fabs(row[0] - row[2]));
        }
    }
    code(end, run->time_low, run->unit, point, w->constants, w->ahead);
    run->expansions += 3;
}

/* How far an expansion agrees with one that is made anew on its step. */
struct agreement {
    bool agrees;    /* in all that is looked at */
    bool kept;      /* in all but guards without branch points */
    double worst;   /* by how much more than allowed something is off */
    double shorter; /* a step on which the terms of what does not agree fall */
};

/* What a row's series comes to at a place on the step: its value, or a state's slope; "size" is that of its terms,
 * beginning with what it is there. */
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

/* Hold the expansion, at a place on the step, against one that is made anew there.
 *
 * "slopes": the code that makes slopes and values alone, or null. "decreasing": the terms fall, so that guards without
 * branch points need no look. "theta" units is the step.
 */
static void compare_at(const struct work *w, double at, double theta, expand_code slopes, bool decreasing,
                       struct agreement *found)
{
    struct run *run = w->run;
    int64_t n = run->states, guards = w->mode->guards, order = run->order;
    double end = run->time + at * run->unit;
    expand_code code = slopes ? slopes : w->mode->expansion;
    w->mode->step_end(at, w->c, w->change);
    for (int64_t i = 0; i < n; i++)
        w->point[i] = w->x[i] + w->change[i];
    code(end, run->time_low, run->unit, w->point, w->constants, w->ahead);
    run->expansions += 1;
    /* From there, too, exponentials must allow a quarter of the step (taylor/llvm/step_bounds.py: longest_step). */
    found->agrees = found->agrees && (slopes || row_ahead(w, n + guards)[3] >= 0.25 * at);
    bool measured = false;
    for (int64_t r = 0; r < n + guards; r++) {
        if (r >= n && w->faint[r - n] != 0)
            continue;
        bool smooth = r >= n && w->mode->guard[r - n].branches == 0;
        if (smooth && decreasing)
            continue;
        int64_t first = r < n ? 1 : 0; /* slopes of states, values of guards */
        double there = row_ahead(w, r)[first], size = fabs(there);
        double off = fabs(predicted_at(row_of(w, r), order, first, at, &size) - there);
        /* A slope that moves its state by no more than rounding over the step is none, whatever its digits. */
        double allowed = larger(1e-6 * size, first == 1 ? 4.0 * EPS * fabs(w->x[r]) / at : 0.0);
        if (r >= n && !smooth && off > allowed) {
            if (!measured)
                guard_rounding(w, code, end);
            measured = true;
            allowed = larger(allowed, w->change[r]);
        }
        if (!(off <= allowed)) {
            found->worst = off < INFINITY ? larger(found->worst, off / allowed) : INFINITY;
            found->agrees = false, found->kept = found->kept && smooth;
            while (found->shorter > LEAST_PART * theta
                   && tail_shape(row_of(w, r), order, found->shorter, 0.0) == NOT_DECREASING)
                found->shorter *= SHORTER;
        }
    }
}

/* A step no longer than where the expansion still holds, theta if that is so.
 *
 * Where terms grow the step is shortened until they fall: then it ends within their circle of convergence. Terms that
 * only sink below rounding, are zero or end in a gap promise nothing (a high power seen from where it is flat), nor do
 * those below rounding on a step much longer than the last one ("grown"). There the expansion is made anew on the step
 * and at its end: guards and slopes must be what was predicted, or the step is shortened and asked again. A step whose
 * terms fall, or one much shorter than the last, needs no such check of guards (where one is next to zero rounding
 * alone may disagree); in slopes and in guards with branch points of their own it does, for behind a branch point the
 * terms of a root may fall as well.
 *
 * Without "unconverged" terms are not looked at: the field or a guard has branch points (slopes), behind which a square
 * root's series, a polynomial perhaps, goes on as if there were none. Slopes, and such guards, are held against it.
 */
static double validated_step(const struct work *w, double theta, bool grown, bool unconverged)
{
    const struct run *run = w->run;
    int64_t rows = run->states + w->mode->guards, order = run->order;
    bool decreasing = true;
    mark_faint(w);
    for (int64_t r = 0; r < (unconverged ? rows : 0); r++) {
        const double *row = row_of(w, r);
        if (r >= run->states && w->faint[r - run->states] != 0)
            continue;
        enum tail tail = tail_shape(row, order, theta, grown ? 0.0 : EPS);
        if (tail == NOT_DECREASING) {
            while (tail_shape(row, order, theta, EPS) == NOT_DECREASING)
                theta *= SHORTER;
            tail = tail_shape(row, order, theta, 0.0);
        }
        decreasing = decreasing && tail == DECREASING;
    }
    expand_code slopes = decreasing ? w->mode->slopes : NULL;
    bool checking = !decreasing || slopes;
    while (checking) {
        struct agreement found = {.agrees = true, .kept = true, .worst = 1.0, .shorter = theta};
        compare_at(w, theta, theta, slopes, decreasing, &found);
        if (found.kept)
            compare_at(w, 0.37 * theta, theta, slopes, decreasing, &found);
        if (found.agrees)
            break;
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

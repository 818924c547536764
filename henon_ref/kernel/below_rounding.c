/* Guards smaller than the rounding errors of the states: such a guard decides nothing.
 *
 * Rounding of a state changes a guard, both directly and through the motion. To measure this, each state is moved by
 * some units in its last place, and the guard's series on the step is computed again. Machine code bounds the rounding
 * of the guard's own operations (henon_ref/taylor/llvm/rounding.py). A root counts if the guard falls by more than both
 * together over the length of a step, or is clearly below zero at the step's end. Otherwise it is ignored on this step.
 * The run continues; if the guard is clearly below zero later, the mode changes there. The run keeps the first time at
 * which it ignored a root of a surface: from there on the recorded transitions may lack some of this surface.
 *
 * A section or kink on which the mode slides, or a body rests, is skipped only while it stands still.
 *
 * If the run ends far beyond such a surface, its mode was wrong: it ends as failed.
 */

/* A fall of a guard by this part of the largest state exceeds rounding: no step multiplies an error by 1e10. */
#define CLEAR_PART 1e-4
/* An end beyond a surface by this part of the size of its function's terms in the states is no error of the steps. */
#define FAR_PART 0.1
/* Number of places at which a guard that begins below zero is examined: it may rise again on the step. */
#define LOOKED_AT 8

/* Rounding error of a guard's own operations; it exceeds that of the states if the guard's terms cancel. */
static double own_rounding(const struct work *w, int64_t guard)
{
    const struct run *run = w->run;
    w->mode->rounding(run->time, run->time_low, OWN_ROUNDING, w->x, w->constants, w->ahead);
    double own = w->ahead[run->states + guard];
    return own < INFINITY ? own : 0.0;
}

/* Change of a guard on a step of theta units by rounding of the states and of its own operations.
 *
 * (The expansions made here are not part of the motion, and not counted.)
 */
static double guard_noise(const struct work *w, int64_t guard, double theta)
{
    int64_t n = w->run->states;
    double noise = own_rounding(w, guard);
    const double *row = guard_row(w, guard), *moved = row_ahead(w, n + guard);
    for (int64_t i = 0; i < n; i++)
        w->point[i] = w->x[i];
    for (int64_t i = 0; i < n; i++)
        if (w->x[i] != 0.0) {
            w->point[i] = w->x[i] + STATE_ROUNDING * w->x[i];
            expand(w, w->point, w->ahead);
            w->point[i] = w->x[i];
            double power = 1.0;
            for (int64_t k = 0; k <= w->run->order; k++) {
                noise += fabs(moved[k] - row[k]) * power;
                power *= theta;
            }
        }
    return noise;
}

/* Check whether the function of a kink or section changes by no more than rounding on a step of at most "natural" units
 * up to the horizon, as it does while a mode slides on the same surface, or a body rests there.
 *
 * Its value then decides nothing, and no crossing is due. The value may have any sign: the present state may be what
 * was left of larger terms that cancelled, such as a speed at which a slide has begun, and their rounding is not known
 * here. (That of the changes of the states, and of the guard's slope, is.) As soon as the function changes, its
 * crossings are located again. A function that is zero with all its derivatives stands still only if rounding does not
 * change the derivatives: v - 1 of a body held at v = 1, not with v' = 1 - v.
 */
static bool stands_still(const struct work *w, int64_t guard, double natural)
{
    const struct run *run = w->run;
    int64_t n = run->states, order = run->order;
    if (!w->mode->guard[guard].kink)
        return false;
    const double *row = guard_row(w, guard), *moved = row_ahead(w, n + guard);
    double noise = 0.0, start = 0.0, theta = smaller(natural, remaining(run) / run->unit), *of_rates = w->speeds;
    w->mode->rounding(run->time, run->time_low, OWN_ROUNDING, w->x, w->constants, of_rates);
    for (int64_t i = 0; i < n; i++)
        w->point[i] = w->x[i];
    for (int64_t i = 0; i < n; i++) {
        double own = (STATE_ROUNDING * size_of_terms(row_of(w, i), 1, order, theta) + of_rates[i] * run->unit) * theta;
        double all = own + STATE_ROUNDING * fabs(w->x[i]), power = 1.0;
        if (!(0.0 < all && all < INFINITY))
            continue;
        w->point[i] = w->x[i] + all;
        expand(w, w->point, w->ahead);
        w->point[i] = w->x[i];
        start += fabs(moved[0] - row[0]) * (own / all);
        for (int64_t k = 1; k <= order; k++) {
            power *= theta;
            noise += fabs(moved[k] - row[k]) * power;
        }
    }
    if (size_of_terms(row, 0, order, 1.0) == 0.0)
        return noise <= NO_ACCOUNT;
    return size_of_terms(row, 1, order, theta) * theta <= start + noise;
}

/* First time at which a guard was below its rounding. */
static double *since_of(const struct work *w, int64_t guard)
{
    const struct guard *own = &w->mode->guard[guard];
    return w->since + rounding_place(own->valid, own->index, w->run->guards);
}

/* Record that a guard is below its rounding, "part" units after the step's start. */
static void passed_over(struct work *w, int64_t guard, double part)
{
    double *since = since_of(w, guard), time = w->run->time + part * w->run->unit;
    if (!(*since <= time)) {
        *since = time;
        w->run->below_rounding += 1;
    }
}

/* Length, in the unit, on which a guard is examined: at most up to the horizon for a polynomial motion, whose steps
 * have any length. */
static double length_looked_at(const struct work *w, double natural)
{
    double left = remaining(w->run) / w->run->unit;
    return w->mode->polynomial_degree > 0 ? smaller(natural, left) : natural;
}

/* Check whether a guard remains below its noise on a step up to its root at tau. */
static bool remains_below_rounding(const struct work *w, int64_t guard, double tau)
{
    const double *row = guard_row(w, guard);
    return larger(row[0], value(row, w->run->order, 0.5 * tau)) <= guard_noise(w, guard, tau);
}

/* Check whether the root of a guard at tau is due to rounding, and record that.
 *
 * "natural": length of the uncut step, in the unit. "flat": the root itself is uncertain; multiprecision decides it,
 * except if the guard has been below its rounding before and remains so up to this root.
 */
static bool root_below_rounding(struct work *w, int64_t guard, double tau, double natural, bool flat)
{
    const struct run *run = w->run;
    if (flat) {
        if (stands_still(w, guard, natural))
            return true;
        bool before = run->below_rounding != 0 && *since_of(w, guard) <= run->time;
        if (!before || !remains_below_rounding(w, guard, tau))
            return false;
    }
    const double *row = guard_row(w, guard);
    double largest = 0.0, slope = 0.0;
    for (int64_t i = 0; i < run->states; i++)
        largest = larger(largest, fabs(w->x[i]));
    for (int64_t k = run->order; k > 0; k--)
        slope = slope * tau + (double)k * row[k];
    double theta = length_looked_at(w, natural);
    double fall = larger(fabs(slope) * theta, -value(row, run->order, theta));
    bool clear = fall >= CLEAR_PART * largest && fall > own_rounding(w, guard);
    if (!clear && stands_still(w, guard, natural))
        return true;
    if (clear || fall > guard_noise(w, guard, theta))
        return false;
    passed_over(w, guard, tau);
    return true;
}

/* Lowest value of a guard on a step of theta units, of those after the whole step, half of it, a quarter, and so on. */
static double lowest_ahead(const struct work *w, int64_t guard, double theta)
{
    double lowest = INFINITY;
    for (int half = 0; half < LOOKED_AT; half++, theta *= 0.5)
        lowest = smaller(lowest, value(guard_row(w, guard), w->run->order, theta));
    return lowest;
}

/* Check whether a guard that is below zero where a step begins (hits) falls further by more than rounding.
 *
 * Guards that do not are removed from the hits, and faint on this step. A guard that stays zero does not fall; it is
 * decided if rounding does not change it. If "undecidable", no guard falls: a guard that is a constant of the motion
 * drifts by the errors of the steps, which are larger than rounding.
 */
static bool fails_beyond_rounding(struct work *w, double natural, bool undecidable)
{
    bool found = false;
    double theta = length_looked_at(w, natural);
    for (int64_t g = 0; g < w->mode->guards; g++)
        if (w->hits[g] == 1) {
            bool zero = size_of_terms(guard_row(w, g), 0, w->run->order, 1.0) == 0.0;
            bool known = zero && *since_of(w, g) <= w->run->time;
            bool still = known || stands_still(w, g, natural);
            double noise = still ? 0.0 : guard_noise(w, g, zero ? 1.0 : theta); /* theta may be infinite */
            if (still || undecidable || zero || (noise > 0.0 && -lowest_ahead(w, g, theta) <= noise)) {
                w->hits[g] = 0, w->faint[g] = 1;
                if (!still && (noise > NO_ACCOUNT || !zero))
                    passed_over(w, g, 0.0);
            } else {
                found = true;
            }
        }
    return found;
}

/* Check whether a run ends beyond a surface of its mode whose roots have been ignored, by far more than any error. */
static bool ends_beyond(struct work *w)
{
    const struct run *run = w->run;
    int64_t n = run->states;
    const double *began = w->origin + 3;
    double largest = 0.0;
    for (int64_t i = 0; i < n; i++)
        largest = larger(largest, larger(fabs(w->x[i]), fabs(began[i])));
    for (int64_t i = 0; i < n; i++)
        w->point[i] = w->x[i];
    for (int64_t g = 0; g < w->mode->guards; g++) {
        if (w->mode->guard[g].kind != SURFACE || !(*since_of(w, g) <= run->time))
            continue;
        const double *value = row_ahead(w, n + g);
        expand(w, w->x, w->ahead);
        double beyond = -value[0], size = 0.0;
        for (int64_t i = 0; i < n && beyond > CLEAR_PART * largest; i++) {
            double all = larger(fabs(w->x[i]), fabs(began[i]));
            w->point[i] = w->x[i] + CLEAR_PART * all;
            expand(w, w->point, w->ahead);
            w->point[i] = w->x[i];
            size += fabs(value[0] + beyond) / CLEAR_PART;
        }
        if (beyond > CLEAR_PART * largest && beyond > FAR_PART * size)
            return true;
    }
    return false;
}

/* Guards that lie below their own rounding: such a one decides nothing.
 *
 * What rounding leaves of a state moves a guard, directly and through the motion: each state is moved by some units in
 * its last place, and the guard's series on the step looked at again. What rounding makes of the guard's own operations
 * machine code bounds (henon_ref/taylor/llvm/rounding.py). A root is decided where the guard falls, over as
 * long as a step is, by more than that, or is clearly below zero at the step's end. Else it is passed over on this
 * step, and from there on nothing is told of its surface (record_transition). The run goes on: where the guard is
 * clearly below zero later, the mode changes there.
 */

/* A guard that falls by this part of the largest state is beyond rounding: on a step no motion makes 1e10 of it. */
#define CLEAR_PART 1e-4

/* What rounding of a guard's own operations may make of it: more than that of the states where its terms cancel. */
static double own_rounding(const struct work *w, int64_t guard)
{
    const struct run *run = w->run;
    w->mode->rounding(run->time, run->time_low, OWN_ROUNDING, w->x, w->constants, w->ahead);
    double own = w->ahead[run->states + guard];
    return own < INFINITY ? own : 0.0;
}

/* What rounding of the states, and its own, may make of a guard on a step of theta units.
 *
 * (Expansions for it are no part of the motion: they are not counted.)
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

/* Since when a guard has been below its rounding. */
static double *since_of(const struct work *w, int64_t guard)
{
    const struct guard *own = &w->mode->guard[guard];
    return w->since + rounding_place(own->valid, own->index, w->run->guards);
}

/* Note that a guard is below its rounding, "part" units behind the step's begin. */
static void passed_over(struct work *w, int64_t guard, double part)
{
    double *since = since_of(w, guard), time = w->run->time + part * w->run->unit;
    if (!(*since <= time)) {
        *since = time;
        w->run->below_rounding += 1;
    }
}

/* Length, in the unit, over which a guard is looked at: no coefficient limits that of a polynomial motion. */
static double length_looked_at(const struct work *w, double natural)
{
    double left = remaining(w->run) / w->run->unit;
    return w->mode->polynomial_degree > 0 ? smaller(natural, left) : natural;
}

/* Whether the root of a guard at tau is rounding's; noted then.
 *
 * "natural": length of the step that nothing has cut short, in the unit. "flat": the root may be none; it is left to
 * multiprecision, the first time.
 */
static bool root_below_rounding(struct work *w, int64_t guard, double tau, double natural, bool flat)
{
    const struct run *run = w->run;
    if (flat) {
        if (run->below_rounding == 0 || !(*since_of(w, guard) <= run->time))
            return false;
        passed_over(w, guard, tau);
        return true;
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
    if (clear || fall > guard_noise(w, guard, theta))
        return false;
    passed_over(w, guard, tau);
    return true;
}

/* Of guards that are below zero where a step begins (hits), whether one falls further by more than rounding.
 *
 * Those that do not are no hits any more, and faint.
 */
static bool fails_beyond_rounding(struct work *w, double natural)
{
    bool found = false;
    double theta = length_looked_at(w, natural);
    for (int64_t g = 0; g < w->mode->guards; g++)
        if (w->hits[g] == 1) {
            double noise = guard_noise(w, g, theta);
            if (noise > 0.0 && -value(guard_row(w, g), w->run->order, theta) <= noise) {
                w->hits[g] = 0, w->faint[g] = 1;
                passed_over(w, g, 0.0);
            } else {
                found = true;
            }
        }
    return found;
}

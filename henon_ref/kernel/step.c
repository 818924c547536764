/* Steps without events, and the state as a compensated sum (x' = f by the Taylor coefficients of the mode's tape). */

/* A step longer than the last one by this factor is validated before it is accepted. */
#define CHECKED_GROWTH 4.0
/* Shortest unit [s]. */
#define SHORTEST_UNIT 1e-280
/* Factor by which the unit is shortened if even coefficients of low order are infinite. */
#define OVERFLOW_REDUCTION 1e-100
/* A run has stalled when the weights of steps too short to move a double's time, 1 unless given below, exceed this
 * sum. */
#define STALLED_STEPS 1000
/* Weight of a step too short to move even the compensated time, on which no state grows. */
#define LOST_WEIGHT 100
/* Weight of a step cut short before a singularity, on which no state grows. */
#define CUT_WEIGHT 200
/* A step that the branch point of a guard cuts to less than the part SHARP_CUT has the weight SHARP_CUT_WEIGHT: forty
 * in a row lead from any scale to the rounding of a root's argument, where predictions are only noise. */
#define SHARP_CUT 0.125
#define SHARP_CUT_WEIGHT 25

/* Check whether some state grows by at least a hundredth on a step of theta units, as a state does that blows up. */
static bool state_grows(const struct work *w, double theta)
{
    bool found = false;
    for (int64_t i = 0; i < w->run->states; i++) {
        const double *row = row_of(w, i);
        found = found || (fabs(row[1]) * theta > 0.01 * fabs(row[0]) && (row[1] > 0.0) == (row[0] > 0.0));
    }
    return found;
}

/* x += change as a compensated sum; false if the state has blown up. */
static inline bool add_to_state(struct work *w)
{
    bool bounded = true;
    for (int64_t i = 0; i < w->run->states; i++) {
        double step = w->change[i] + w->x_low[i], x = w->x[i], total = x + step, part = total - x;
        w->x_low[i] = (x - (total - part)) + (step - part);
        w->x[i] = total;
        bounded = bounded && fabs(total) < BLOWN_UP;
    }
    return bounded;
}

/* Begin a mode with the length of its own last step, if the run has been in this mode before.
 *
 * Which modes are remembered depends on this run alone, not on the modes that other runs have compiled.
 */
static void enter_mode(struct work *w)
{
    struct run *run = w->run;
    int64_t place = 0, words = w->words ? w->words : 1;
    size_t size = (size_t)words * sizeof(int64_t);
    const int64_t *mode = w->words ? w->entries : &run->mode;
    while (place < run->remembered && memcmp(w->remembered + place * words, mode, size) != 0)
        place += 1;
    bool stays = w->words && place < run->remembered && place == run->step_place;
    run->stepped_mode = run->mode;
    if (stays) /* several events at one instant have led back to the mode of the last step */
        return;
    if (place == REMEMBERED_STEPS) /* all further modes share the last place */
        place -= 1;
    else if (place == run->remembered)
        run->remembered += 1;
    memcpy(w->remembered + place * words, mode, size);
    run->step_place = place;
    if (w->last_steps[place] > 0.0)
        run->unit = smaller(w->last_steps[place], run->longest_step);
}

/* Steps shorter than this part of the unit are examined: guards that are only rounding may have shortened them. */
#define SHORT 1e-6

/* Step, in the unit, that the present expansion allows; 0 if a coefficient is not finite. */
static inline double proposed_step(const struct work *w, int64_t rows, int64_t zeros)
{
    double theta = step_size(w, w->c, rows);
    if (infinite(w, rows, w->mode->polynomial_degree))
        theta = 0.0;
    if (zeros > 2 && theta > 0.0)
        return flat_step_size(w, rows);
    if (0.0 < theta && theta < SHORT) {
        double other = flat_step_size(w, rows);
        theta = other > 1e3 * theta ? other : theta;
    }
    return theta;
}

/* Whether multiprecision has examined the guards here twice: if it has kept the mode, they decide nothing on the next
 * step. */
static inline bool decided_twice(const struct run *run)
{
    return run->guard == NOWHERE && run->events_at_once > 1;
}

/* Take steps on which no guard can reach zero; return with the coefficients of the first step that must be examined.
 *
 * "alone": examine the first step, as is necessary if a guard is at zero or may have a branch point. "shrunk": the unit
 * was shortened for a near event, and must not grow here. Returns ON, and the proposed step; or BUDGET_SPENT, STALLED
 * if the step size is zero, DIVERGED, STEPS_FULL, or OUT_OF_RANGE; or BEFORE_STEP, if the run steps together with other
 * runs.
 */
static inline int64_t event_free_steps(struct work *w, bool alone, bool shrunk, int64_t stop_at, double *proposed)
{
    struct run *run = w->run;
    int64_t n = run->states, guards = w->mode->guards, rows = n + guards, zeros = 0;
    for (int64_t g = 0; g < guards; g++)
        if (w->known_zeros[g] > zeros)
            zeros = w->known_zeros[g];
    alone = alone || zeros > 0 || w->mode->branches;
    double last = run->unit; /* [s]: length of the last step */
    while (true) {
        if (run->steps >= stop_at)
            return BUDGET_SPENT;
        if (run->stepping == TOGETHER && w->mode->lanes && !shrunk && !decided_twice(run))
            return BEFORE_STEP;
        double left = remaining(run), unit = run->unit;
        int raised = 0;
        w->changed_by = -1.0;
        if (run->stepping != FROM_LANES) {
            lower_range_flags();
            expand(w, w->x, w->c);
            raised = raised_range_flags();
        }
        run->stepping = least(run->stepping, TOGETHER);
        run->expansions += 1;
        double theta = proposed_step(w, rows, zeros);
        if (theta < SHORT || (theta > 1e6 && unit < left && !shrunk)) {
            /* The unit is far from the step: adapt it and expand again before using the coefficients. If the unit is
             * much too long, the proposed step is wrong, too: the unit shrinks in several passes, and does not grow
             * again here. */
            double part = theta == 0.0 && infinite(w, rows, 2) ? OVERFLOW_REDUCTION : 1e-4;
            double new = theta < 1.0 ? larger(unit * larger(theta, part), 1e-290) : smaller(unit * theta, left);
            if (unit <= SHORTEST_UNIT && new <= unit)
                return STALLED;
            if (new < 0.5 * unit || new > 2.0 * unit) {
                shrunk = shrunk || new < unit;
                run->unit = new;
                run->stepping = run->stepping == TOGETHER ? ONCE_ALONE : ALONE; /* "last" is not the unit now */
                continue;
            }
        }
        double whole = smaller(theta, left / unit);
        w->hidden = whole > 0.0 && may_hide_terms(w, theta * unit, last) && has_hidden_terms(w, whole);
        if (shrunk) {
            theta = smaller(theta, 1e6);
            shrunk = false;
        }
        double step = theta * unit;
        if (below_time_resolution(run, step))
            run->stalled += below_compensated_resolution(run, step) && !state_grows(w, theta) ? LOST_WEIGHT : 1;
        if (run->stalled > STALLED_STEPS)
            return STALLED;
        if (raised != 0 && out_of_range(w, raised, smaller(theta, left / unit)))
            return OUT_OF_RANGE;
        *proposed = theta;
        if (alone || w->hidden || step >= left || theta > CHECKED_GROWTH || tail_unconverged(w, rows, theta))
            return ON;
        change_over(w, theta);
        for (int64_t g = 0; g < guards; g++)
            if (!(w->lower[g] > 0.0))
                return ON;
        if (!add_to_state(w))
            return DIVERGED;
        if (!below_time_resolution(run, step))
            run->stalled = 0;
        bool full = run->dense && record_step(w, step);
        add_to_time(run, step);
        run->steps += 1;
        run->unit = smaller(step, 1e3 * unit), last = step;
        if (full)
            return STEPS_FULL;
    }
}

/* A shift below this part of a step moves the states along their tangents: quadratic terms are below rounding. */
#define ALONG_TANGENT 1e-9

/* Move the end of a slide onto the zero of its guard to the last digit, whatever the tolerance of the step.
 *
 * A slide ends at a tangent point, where the normal velocity of one field vanishes. If the slide ended slightly before
 * that point, the field would point back at the surface, and the slide would begin again. Newton's method on the
 * expansion at the landing. "theta" and "unit" are those of the step; the run's unit may have changed since.
 */
static void refine_release(struct work *w, int64_t guard, double unit, double theta)
{
    struct run *run = w->run;
    for (int step = 0; step < 3; step++) {
        w->mode->slopes(run->time, run->time_low, unit, w->x, w->constants, w->ahead);
        run->expansions += 1;
        const double *row = row_ahead(w, run->states + guard);
        double off = row[0], slope = row[1], size = fabs(off) + fabs(slope) * theta;
        if (fabs(off) <= 2.0 * EPS * size || !(slope < 0.0))
            return;
        double shift = -off / slope;
        if (fabs(shift) > 0.1 * theta || run->time + shift * unit > run->horizon)
            return;
        w->changed_by = -1.0;
        for (int64_t i = 0; i < run->states; i++)
            w->change[i] = shift * row_ahead(w, i)[1];
        if (fabs(shift) > ALONG_TANGENT * theta) {
            w->mode->expansion(run->time, run->time_low, unit, w->x, w->constants, w->ahead);
            w->mode->step_end(shift, w->ahead, w->change);
        }
        add_to_state(w);
        add_to_time(run, shift * unit);
    }
}

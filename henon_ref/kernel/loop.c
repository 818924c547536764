/* The mode loop: Taylor steps, events, landings and ordinary mode changes without leaving machine code.
 *
 * The loop returns to Python (henon_ref/integrator/run.py) with a code if double precision does not decide the next
 * mode (several events at once, a tangency, a rest), or if a mode is not compiled yet. After Python's answer the loop
 * continues.
 */

/* Steps after which the loop returns, so that Python can check the clock. */
#define BUDGET 50000
/* An event within this part of the unit is examined in a shorter unit: powers of its place would underflow. */
#define TINY_PART 1e-60

/* A candidate step, on which all guards are examined. */
struct look {
    double theta;   /* length, in the unit */
    double natural; /* [s]: length by step size and validation, before it is cut at the horizon. (The argument
                       "natural" of other functions is this length in the unit.) */
    bool final;     /* whether the step ends at the horizon */
    bool cut;       /* whether the branch point of a guard has cut the step short */
};

/* Check whether a step can be taken: ON, or the reason why not. */
static inline int64_t before_step(const struct work *w)
{
    const struct run *run = w->run;
    if (run->transitions + 1 > run->transition_capacity)
        return BLOCK_FULL;
    if (remaining(run) <= 0.0)
        return HORIZON;
    if (run->dense && run->dense_steps >= run->dense_capacity)
        return STEPS_FULL;
    return ON;
}

/* Candidate step of the proposed length, cut at the horizon and where the expansion ceases to hold. */
static inline struct look accepted_step(struct work *w, double theta)
{
    struct run *run = w->run;
    int64_t rows = run->states + w->mode->guards;
    double unit = run->unit;
    if (w->mode->branches && 0.0 < run->longest_step && run->longest_step < theta * unit)
        theta = run->longest_step / unit; /* a branch point may have cut the last step short */
    struct look look = {.theta = theta, .natural = theta * unit};
    double left = remaining(run);
    look.final = look.natural >= left;
    if (look.final)
        look.theta = left / unit;
    bool grown = look.natural > CHECKED_GROWTH * unit;
    double last = w->last_steps[run->step_place];
    if (grown && look.final && left <= last) /* the last part before the horizon is no step that has grown */
        grown = false, look.natural = smaller(look.natural, last);
    bool unconverged = w->mode->polynomial_degree == 0 && (grown || w->hidden || tail_unconverged(w, rows, look.theta));
    if (!unconverged && !w->mode->branches)
        return look;
    double accepted = validated_step(w, look.theta, grown, unconverged);
    if (accepted < look.theta) {
        look.cut = w->mode->guards_branch > 0 && accepted < SHARP_CUT * look.theta;
        look.theta = accepted, look.final = false;
        look.natural = look.theta * unit;
        if (below_time_resolution(run, look.natural) && !state_grows(w, look.theta))
            run->stalled += CUT_WEIGHT;
        else if (look.cut)
            run->stalled += SHARP_CUT_WEIGHT;
    }
    return look;
}

/* First event on the step that is larger than rounding. */
static inline struct event decided_event(struct work *w, const struct look *look)
{
    double natural = look->natural / w->run->unit;
    while (true) {
        struct event event = first_event(w, look->theta, natural);
        if (event.guard < 0
            || !root_below_rounding(w, event.guard, event.part * look->theta, natural, event.undecided))
            return event;
        w->faint[event.guard] = 1;
    }
}

/* Where the terms of a polynomial motion cancel too much, shorten the step, or leave its event undecided. */
static inline void spare_digits(struct work *w, struct look *look, struct event *event)
{
    struct run *run = w->run;
    double reach = event->guard < 0 ? look->theta : event->part * look->theta;
    double shorter = cancellation_limit(w, run->states + w->mode->guards, reach);
    if (shorter < reach && event->guard >= 0) { /* multiprecision has enough digits */
        event->undecided = true;
    } else if (shorter < reach) {
        look->theta = shorter, look->final = false;
        look->natural = look->theta * run->unit;
        change_over(w, look->theta);
    }
}

/* Add an event at the horizon: the horizon belongs to the run. */
static inline void find_event_at_horizon(const struct work *w, const struct look *look, struct event *event)
{
    for (int64_t g = 0; g < w->mode->guards; g++)
        if (ends_at_zero(w, g, look->theta) && w->faint[g] == 0
            && !load_equals_friction(w, g, look->natural / w->run->unit))
            *event = (struct event){1.0, g, true, event->landing};
}

/* Take a step, up to its event if there is one; return EVENT, ON, or the reason for leaving the loop. "part" is the
 * length taken, in the unit (event->part is relative to the candidate's theta). */
static inline int64_t take_step(struct work *w, const struct look *look, const struct event *event, double part)
{
    struct run *run = w->run;
    double unit = run->unit, step = part * unit;
    if (event->guard >= 0) {
        change_over(w, part);
        for (int64_t g = 0; g < w->mode->guards; g++)
            w->hits[g] = w->faint[g] == 0
                         && (g == event->guard || (!above_zero_by_bound(w, g) && at_zero(w, g, part)));
    }
    if (run->dense && part > 0.0)
        record_step(w, step);
    bool bounded = add_to_state(w);
    if (!(below_time_resolution(run, step) || look->cut))
        run->stalled = 0;
    add_to_time(run, step);
    run->steps += 1;
    run->longest_step = part > 0.0 ? 1e3 * part * unit : unit;
    run->unit = part > 0.0 ? smaller(look->natural, run->longest_step) : unit;
    w->last_steps[run->step_place] = look->natural;
    if (!bounded)
        return DIVERGED;
    if (event->guard >= 0) {
        if (w->mode->guard[event->guard].kind == RELEASE)
            refine_release(w, event->guard, unit, look->theta);
        return EVENT;
    }
    for (int64_t g = 0; g < w->mode->guards; g++)
        w->known_zeros[g] = 0;
    if (!look->final)
        return ON;
    run->time = run->horizon, run->time_low = run->horizon_low;
    return HORIZON;
}

/* Take the steps on which a bound keeps all guards positive (event_free_steps in step.c: most steps), then one
 * candidate step on which the guards are examined.
 *
 * "shrunk": whether the unit was shortened because an event is very near. Returns EVENT if the run has reached an
 * event, ON if the loop continues, else the reason for leaving it.
 */
static int64_t look_ahead(struct work *w, int64_t stop_at, bool *shrunk)
{
    struct run *run = w->run;
    bool undecidable = run->mode == run->stepped_mode && decided_twice(run);
    enter(w);
    if (run->mode != run->stepped_mode)
        enter_mode(w);
    int64_t code = before_step(w);
    if (code != ON)
        return code;
    bool sampled = run->next_sample < w->sample_count;
    double theta;
    code = event_free_steps(w, sampled, *shrunk, stop_at, &theta);
    if (code != ON)
        return code;
    double unit = run->unit;
    struct look look = accepted_step(w, theta);
    change_over(w, look.theta);
    for (int64_t g = 0; g < w->mode->guards; g++)
        w->faint[g] = 0;
    if (guards_below_zero(w, look.natural / unit) && fails_beyond_rounding(w, look.natural / unit, undecidable)) {
        run->guard = NOWHERE; /* multiprecision examines the guards */
        return SELECT_MODE;
    }
    struct event event = decided_event(w, &look);
    *shrunk = event.guard >= 0 && event.part * look.theta < TINY_PART;
    if (*shrunk) {
        if (unit <= SHORTEST_UNIT)
            return STALLED;
        run->unit = larger(unit * larger(2.0 * event.part * look.theta, TINY_PART), SHORTEST_UNIT);
        return ON;
    }
    if (!event.undecided && w->mode->polynomial_degree > 2)
        spare_digits(w, &look, &event);
    if (look.final && event.guard < 0)
        find_event_at_horizon(w, &look, &event);
    double part = event.guard < 0 ? look.theta : event.part * look.theta;
    if (sampled)
        fill_samples(w, part);
    run->guard = event.guard, run->landing = event.undecided ? BRACKET : event.landing;
    if (event.undecided) {
        run->suspect = part * unit, run->step_length = look.theta * unit, run->natural_length = look.natural;
        if (w->mode->branches)
            run->longest_step = 1e3 * look.theta * unit;
        return settle_event(w);
    }
    return take_step(w, &look, &event, part);
}

/* Run up to the horizon, or until the loop cannot continue; return an enum return_code. */
static int64_t proceed(struct work *w)
{
    struct run *run = w->run;
    int64_t stop_at = least(run->steps + BUDGET, run->most_steps);
    int64_t pending = run->event_pending, code = pending == 0 ? ON : EVENT;
    bool shrunk = false;
    if (run->steps == 0)
        keep_origin(w);
    run->event_pending = 0;
    if (pending == UNSETTLED)
        code = settle_event(w);
    while (true) {
        if (code == EVENT) {
            int64_t expansions = run->expansions;
            code = apply_event(w);
            if (run->event_pending != 0) /* the event is repeated, and counted then */
                run->expansions = expansions;
            if (code == ON && run->stopped != 0)
                return STOPPED;
        }
        if (code == HORIZON)
            fill_samples_at_horizon(w);
        if (code == HORIZON && run->below_rounding != 0 && ends_beyond(w))
            return BEYOND;
        if (code != ON)
            return code;
        code = look_ahead(w, stop_at, &shrunk);
    }
}

/* Work space of a run that begins or continues. */
static inline struct work work_to_proceed(struct run *run, const struct tables *tables)
{
    struct work work = work_of(run, tables);
    put_together(&work);
    return work;
}

/* Run up to the horizon, or until Python is needed.
 *
 * run: begin of the run's block (struct places). samples: (count, 1 + n + 1): times of the samples; their states and
 * modes are filled in. Returns an enum return_code, UNDECIDED_EVENT if double precision cannot decide an event.
 */
HENON_EXPORT int64_t advance(struct run *run, const struct tables *tables, double *samples, int64_t count)
{
    struct work work = work_to_proceed(run, tables);
    work.samples = samples, work.sample_count = count;
    return proceed(&work);
}

/* Do a run from its start: the first part of its block, up to end_of_state of struct places. Returns as advance(). */
HENON_EXPORT int64_t whole_run(struct run *run, const struct run *start, const struct tables *tables)
{
    memcpy((double *)run, (const double *)start, (size_t)places_of_run(start).end_of_state * sizeof(double));
    return advance(run, tables, NULL, 0);
}

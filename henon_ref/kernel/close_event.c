/* Events that double precision does not decide, decided in double-double: grazes, close roots, events at the horizon.
 *
 * The motion is expanded anew from the start of the step (pair_series.c). The state there is known to two doubles or,
 * in the first mode of a run, to all digits that double-double keeps from the run's start on. By its Bernstein
 * coefficients, the guard in question is positive up to a neighbourhood of the suspected place; by the signs of their
 * differences, it falls, rises or has one minimum there (near_zero.c). Whether it reaches zero then depends on one
 * number, the minimum, which is known with an error bound. Multiprecision
 * (henon_ref/integrator/multiprecision_event.py) decides if this bound does not, if another guard may be at zero
 * before, or if two normal velocities do not determine the next mode.
 */

/* Largest number of steps by which one event may continue the motion from the run's start. */
#define PAIR_STEPS 64
/* Smallest part to which these steps are shortened, and the number of terms up to which the next one is twice as
 * long: with twice as many terms, a step of an entire function is four times as long. */
#define PAIR_PART 0x1p-6
#define FEW_TERMS 40
/* Largest relative difference of the state from the motion since the run's start before errors count as grown. */
#define SAME_MOTION 1e-2
/* The motion is expanded up to this multiple of the distance to the suspected place. */
#define EXPANDED 1.25
/* Relative rounding error of a difference of two times. */
#define TIME_ROUNDING 2e-17
/* Relative precision of double-double; smaller rests of a number count as zero. */
#define PAIR_ROUNDING 0x1p-106

/* Smallest power of two that is no smaller than a length. */
static inline double unit_above(double length)
{
    int exponent;
    double part = frexp(length, &exponent);
    return ldexp(1.0, part == 0.5 ? exponent - 1 : exponent);
}

/* Store time and state at a run's start, in double-double. */
static void keep_origin(struct work *w)
{
    const struct run *run = w->run;
    double *origin = w->origin;
    origin[0] = run->time, origin[1] = run->time_low, origin[2] = 1.0;
    double *high = origin + 3, *low = high + run->states, *error = low + run->states;
    bool exact = run->time_low == 0.0;
    for (int64_t i = 0; i < run->states; i++)
        exact = exact && w->x_low[i] == 0.0;
    for (int64_t i = 0; i < run->states; i++)
        high[i] = w->x[i], low[i] = w->x_low[i], error[i] = exact ? 0.0 : PAIR_ROUNDING * fabs(w->x[i]);
}

static bool make_room(struct pair_expansion *e)
{
    e->series = e->tape ? malloc((size_t)(2 * e->tape->operations) * sizeof(struct pair_series)) : NULL;
    return e->series != NULL;
}

/* Continue the motion from the run's start to the start of the step; false if that is not possible. */
static bool motion_from_start(const struct work *w, struct pair_expansion *e, struct bounded *state)
{
    const struct run *run = w->run;
    int64_t n = run->states;
    double *origin = w->origin, *high = origin + 3, *low = high + n, *error = low + n, largest = 0.0;
    double *part = &origin[2]; /* length of a step, relative to that of the present step; 0 if no start is stored */
    if (*part > 0.0)
        *part = larger(*part, 1.0);
    for (int step = 0; step < PAIR_STEPS; step++) {
        struct pair from = {origin[0], origin[1]};
        struct pair left = added((struct pair){run->time, run->time_low}, negative(from));
        if (left.high < 0.0 || *part < PAIR_PART)
            return false;
        if (left.high == 0.0 && left.low == 0.0)
            break;
        for (int64_t i = 0; i < n; i++)
            state[i] = (struct bounded){high[i], low[i], error[i]};
        double length = *part * run->step_length;
        bool last = left.high <= length;
        struct pair stretch = last ? left : (struct pair){length, 0.0};
        e->unit = unit_above(stretch.high), e->reach = stretch.high / e->unit;
        expand_in_pairs(e, known_to(from.high, from.low, PAIR_ROUNDING), state, PAIR_TERMS);
        if (!e->converged) {
            *part *= 0.5;
            continue;
        }
        struct powers powers;
        powers_at(e, (struct pair){stretch.high / e->unit, stretch.low / e->unit}, &powers);
        for (int64_t i = 0; i < n; i++) {
            struct bounded there = value_in_pairs(e, &e->series[i], &powers.own);
            high[i] = there.high, low[i] = there.low, error[i] = there.error;
        }
        if (e->terms <= FEW_TERMS)
            *part *= 2.0;
        struct pair time = last ? (struct pair){run->time, run->time_low} : added(from, stretch);
        origin[0] = time.high, origin[1] = time.low;
    }
    if (origin[0] != run->time || origin[1] != run->time_low)
        return false;
    for (int64_t i = 0; i < n; i++)
        largest = larger(largest, fabs(w->x[i]));
    for (int64_t i = 0; i < n; i++) {
        state[i] = (struct bounded){high[i], low[i], error[i]};
        if (!(fabs((high[i] - w->x[i]) + low[i]) <= SAME_MOTION * larger(fabs(w->x[i]), SAME_MOTION * largest)))
            return false;
    }
    return true;
}

/* State at the start of the step, to all known digits; "rounded": whether these are those of the compensated double. */
static bool all_digits(const struct work *w, struct pair_expansion *e, struct bounded *state, bool *rounded)
{
    *rounded = w->run->more_digits == 0 || w->run->remembered != 1;
    if (!*rounded)
        return motion_from_start(w, e, state);
    for (int64_t i = 0; i < w->run->states; i++)
        state[i] = (struct bounded){w->x[i], w->x_low[i], 0.0};
    return true;
}

/* Check whether another guard than the suspected one has no event up to a place. */
static bool has_no_event(const struct work *w, const struct pair_expansion *e, int64_t g, double end, double natural)
{
    const struct pair_series *q = series_of(e, w->run->states + g);
    int64_t zeros = w->known_zeros[g], degree = e->terms - 1 - zeros;
    double size = 0.0, power = 1.0;
    if (load_equals_friction(w, g, natural))
        return true;
    if (degree < 0)
        return false;
    for (int64_t k = 1; k <= degree; k++) {
        power *= end;
        size += (fabs(q->high[zeros + k]) + q->error[zeros + k]) * power;
    }
    size += q->error[zeros];
    double first = q->high[zeros], sign = w->mode->guard[g].rising_only && first < 0.0 ? -1.0 : 1.0;
    for (int64_t k = 0; k < zeros; k++)
        if (!(fabs(q->high[k]) <= KNOWN_ZERO_LEVEL * fabs(first)))
            return false;
    if (sign * first - size > KNOWN_ZERO_LEVEL * (fabs(first) + size))
        return true;
    struct bernstein whole;
    bernstein_of(e, q, zeros, end, &whole);
    for (int64_t i = 0; i <= whole.degree; i++)
        whole.b[i] *= sign;
    double level = whole.noise + (zeros > 0 ? KNOWN_ZERO_LEVEL * (fabs(first) + size) : 0.0);
    return above(whole.b, whole.degree, level, HALVINGS);
}

/* How the motion leaves a guard's surface on the other side: the first two coefficients of the distance from it there,
 * and the first coefficient that is not known to be zero, with its order. */
struct beyond {
    struct bounded rate, bend, leading;
    int64_t order;
};

/* Expand the mode across a guard at a point on its surface, and read off these coefficients; false if that fails. */
static bool look_beyond(struct work *w, const struct pair_expansion *own, const struct guard *guard,
                        struct bounded time, const struct bounded *state, struct beyond *found)
{
    int64_t surface = guard->index, back = go_over(w, surface, guard->mode_across);
    struct pair_expansion e = {.tape = w->mode->tape, .constants = w->constants};
    e.unit = own->unit, e.reach = own->reach;
    bool there = false;
    if (make_room(&e)) {
        expand_in_pairs(&e, time, state, FLATTEST + 1);
        for (int64_t k = 0; k < w->mode->guards; k++)
            if (is_on(&w->mode->guard[k], surface)) {
                const struct pair_series *q = series_of(&e, w->run->states + k);
                found->rate = term(q, 1);
                found->bend = e.terms > 2 ? term(q, 2) : exactly(0.0);
                found->order = 1;
                while (found->order + 1 < e.terms && exact_zero(term(q, found->order)))
                    found->order += 1;
                found->leading = term(q, found->order);
                there = true;
            }
        free(e.series);
    }
    go_over(w, surface, back);
    return there;
}

/* Determine the transition where a guard falls through zero or touches it; false if two numbers do not decide it.
 *
 * After a touch the mode continues without a transition, unless the other side's field leads away as well. The mode
 * found is -1 if it must be compiled first: how an event is decided does not depend on what was compiled before.
 */
static bool change_at(struct work *w, const struct pair_expansion *e, int64_t g, struct near_place near,
                      struct bounded time, const struct bounded *state, struct change *found)
{
    const struct guard *guard = &w->mode->guard[g];
    bool touching = near.what == TOUCHING;
    *found = (struct change){RELEASED, guard->mode_across, guard->zeros_at_release};
    if (guard->kind == VALID || guard->coupled != UNCOUPLED || guard->hold_zone != 0 || guard->jump)
        return false;
    if (guard->mode_across < 0)
        return true;
    if (guard->kind == RELEASE && near.what == FALLING && near.order > 1) { /* left tangentially to a higher order */
        found->zeros += near.order - 1;
        return guard->zeros_at_release == 2;
    }
    if (guard->kind == RELEASE)
        return found->zeros > 0;
    struct beyond away;
    if (!look_beyond(w, e, guard, time, state, &away))
        return false;
    bool clear = fabs(away.leading.high) > CLEAR * away.leading.error;
    if (touching && away.order > 1)
        return clear && away.leading.high < 0.0;
    if (near.order > 1 && !touching) { /* as flat beyond, and increasing: no sliding without a gradient */
        *found = (struct change){CROSSING, guard->mode_across, near.order};
        return clear && away.order == near.order && away.leading.high > 0.0;
    }
    double derivative[4], error = away.rate.error + KNOWN_PLACE * fabs(away.bend.high);
    derivatives(e, series_of(e, w->run->states + g), near.at.high, derivative);
    if (!(fabs(away.rate.high) > larger(CLEAR * error, TANGENT * fabs(derivative[1]))))
        return false;
    if (touching)
        return away.rate.high < 0.0;
    if (away.rate.high > 0.0)
        *found = (struct change){CROSSING, guard->mode_across, 1};
    else
        *found = (struct change){STICK, guard->mode_stuck, 0};
    return true;
}

/* Split a number into two doubles. */
static void split(struct bounded number, double *high, double *low)
{
    *high = number.high;
    *low = fabs(number.low) > PAIR_ROUNDING * fabs(number.high) ? number.low : 0.0;
}

/* Take the step up to a place with known state. */
static void step_to(struct work *w, struct bounded time, const struct bounded *state, double length)
{
    struct run *run = w->run;
    if (run->dense && length > 0.0)
        record_step(w, length);
    split(time, &run->time, &run->time_low);
    for (int64_t i = 0; i < run->states; i++)
        split(state[i], &w->x[i], &w->x_low[i]);
    run->steps += 1;
    for (int64_t g = 0; g < w->mode->guards; g++)
        w->known_zeros[g] = 0;
}

/* Step to the event or minimum of a guard near the suspected place; EVENT if the state jumps there, UNDECIDED_EVENT if
 * the guard remains open. */
static int64_t settle(struct work *w, struct pair_expansion *e, int64_t g, double natural, struct bounded *state)
{
    struct run *run = w->run;
    const struct guard *guard = &w->mode->guard[g];
    bool rounded;
    if (w->known_zeros[g] > 0 || !all_digits(w, e, state, &rounded))
        return UNDECIDED_EVENT;
    double reach = EXPANDED * run->suspect;
    if (w->mode->branches)
        reach = smaller(reach, run->step_length);
    e->unit = unit_above(reach), e->reach = reach / e->unit;
    expand_in_pairs(e, known_to(run->time, run->time_low, 0.0), state, PAIR_TERMS);
    if (!e->converged)
        return UNDECIDED_EVENT;
    const struct pair_series *q = series_of(e, run->states + g);
    struct near_place near = near_zero(e, q, run->suspect / e->unit);
    if (near.what == OPEN || (rounded && !(near.depth > CLEAR * guard_noise(w, g, reach / run->unit))))
        return UNDECIDED_EVENT;
    for (int64_t k = 0; k < w->mode->guards; k++)
        if (k != g && !has_no_event(w, e, k, smaller(near.at.high * (1.0 + NARROWEST), e->reach), natural))
            return UNDECIDED_EVENT;
    struct powers powers;
    powers_at(e, near.at, &powers);
    for (int64_t i = 0; i < run->states; i++)
        state[i] = value_in_pairs(e, &e->series[i], &powers.own);
    struct pair step = {near.at.high * e->unit, near.at.low * e->unit};
    struct pair end = added((struct pair){run->time, run->time_low}, step);
    struct bounded time = {end.high, end.low, 0.0};
    double left = (run->horizon - end.high) + (run->horizon_low - end.low);
    double nothing = TIME_ROUNDING * fabs(run->horizon);
    bool event = near.what == FALLING || near.what == TOUCHING;
    bool late = left < (event ? -nothing : nothing);
    struct change found = {0};
    bool jumps = near.what == FALLING && guard->jump && !late;
    if (event && !late && !jumps) {
        if (!change_at(w, e, g, near, time, state, &found))
            return UNDECIDED_EVENT;
        if (found.mode < 0) {
            run->pending_kind = found.kind, run->pending_mode = -1, run->event_pending = UNSETTLED;
            return MODE_NOT_COMPILED;
        }
    }
    step_to(w, time, state, step.high);
    if (jumps) { /* jump.c decides what follows */
        for (int64_t k = 0; k < w->mode->guards; k++)
            w->hits[k] = k == g ? 1 : 0;
        return EVENT;
    }
    leave(w);
    if (late) {
        run->time = run->horizon, run->time_low = run->horizon_low;
    } else if (near.what == FALLING) {
        int64_t index = guard->index, side = guard->side, mode = run->mode;
        put_on_surfaces(w);
        go_over(w, index, found.mode);
        record_transition(w, found.kind, index, side, mode, run->mode);
        set_known_zeros(w, w->mode, index, found.zeros);
        if (events_accumulate(run))
            return EVENTS_ACCUMULATE;
    } else if (near.what != RISING) {
        w->known_zeros[g] = near.order;
        if (near.what == TOUCHING && guard->kind == SURFACE) /* a touch of a slide's end is not reported */
            record_transition(w, GRAZE, guard->index, 0, run->mode, run->mode);
    }
    return run->stopped ? STOPPED : ON;
}

/* Decide the event that double precision left undecided on a step; UNDECIDED_EVENT if multiprecision is needed. */
static int64_t settle_event(struct work *w)
{
    struct pair_expansion e = {.tape = w->mode->tape, .constants = w->constants};
    if (!make_room(&e))
        return UNDECIDED_EVENT;
    struct bounded *state = malloc((size_t)w->run->states * sizeof(struct bounded));
    int64_t code = state ? settle(w, &e, w->run->guard, w->run->natural_length / w->run->unit, state) : UNDECIDED_EVENT;
    free(state);
    free(e.series);
    return code;
}

/* What double precision does not decide, decided in double-double: a graze, roots next to each other, an event at the
 * horizon.
 *
 * The motion is expanded anew from where the step begins (pair_series.c), whose state is known to two doubles or, in
 * the first mode of a run, to all digits that double-double keeps from the start on. The guard in question is positive
 * up to a neighbourhood of the place, by its Bernstein coefficients, and there it falls, rises or has one minimum, by
 * the signs of their differences. Whether it reaches zero is then a matter of one number, its minimum, which is known
 * with a bound of its error. Nothing is decided that this bound leaves open, nor where another guard may be at zero
 * before: that is multiprecision's (henon_ref/henon/multiprecision_event.py), and so is what no two velocities tell.
 */

/* Steps of the motion from the start on that one event may take. */
#define PAIR_STEPS 64
/* Shortest part of the length asked for that they are shortened to. */
#define PAIR_PART 0x1p-6
/* Part of its size by which a double may be off the motion from the start, for errors not to have grown. */
#define SAME_MOTION 1e-2
/* So many times as far as the place the motion is expanded. */
#define EXPANDED 1.25
/* Neighbourhoods of the place, in parts of the way there: the widest, and how much narrower the next one is. */
#define WIDEST 0x1p-3
#define NARROWER 0x1p-3
#define NARROWEST 0x1p-21
/* Halvings by which a guard is shown to be positive. */
#define HALVINGS 6
/* To which a root is known, in the unit of the expansion, if it is. */
#define KNOWN_PLACE 0x1p-62
/* So many times its error a number is clear of zero. */
#define CLEAR 2.0
/* Of a time, what rounding leaves of a difference of two. */
#define TIME_ROUNDING 2e-17
/* Part of a number below which what rounding lost of it is nothing. */
#define PAIR_ROUNDING 0x1p-106

/* What a guard does next to where it was seen near zero: TOUCHING it does exactly, in numbers that doubles hold. */
enum nearby { OPEN, RISING, VALLEY, TOUCHING, FALLING };

/* That, and where: its minimum (VALLEY, TOUCHING), its root (FALLING). */
struct near_place {
    int64_t what;
    struct pair at;
    double depth; /* how far from zero what decides it is */
};

/* A power of two no smaller than a length. */
static inline double unit_above(double length)
{
    int exponent;
    double part = frexp(length, &exponent);
    return ldexp(1.0, part == 0.5 ? exponent - 1 : exponent);
}

/* Remember where a run begins. */
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

/* Go on with the motion from the start up to where the step begins; false where that cannot be done. */
static bool motion_from_start(const struct work *w, struct pair_expansion *e, struct bounded *state)
{
    const struct run *run = w->run;
    int64_t n = run->states;
    double *origin = w->origin, *high = origin + 3, *low = high + n, *error = low + n, part = 1.0, largest = 0.0;
    for (int step = 0; step < PAIR_STEPS; step++) {
        struct pair from = {origin[0], origin[1]};
        struct pair left = added((struct pair){run->time, run->time_low}, negative(from));
        if (origin[2] != 1.0 || left.high < 0.0 || part < PAIR_PART)
            return false;
        if (left.high == 0.0 && left.low == 0.0)
            break;
        for (int64_t i = 0; i < n; i++)
            state[i] = (struct bounded){high[i], low[i], error[i]};
        double length = part * run->step_length;
        bool last = left.high <= length;
        struct pair stretch = last ? left : (struct pair){length, 0.0};
        e->unit = unit_above(stretch.high), e->reach = stretch.high / e->unit;
        expand_in_pairs(e, known_to(from.high, from.low, PAIR_ROUNDING), state, PAIR_TERMS);
        if (!e->converged) {
            part *= 0.5;
            continue;
        }
        struct powers powers;
        powers_at(e, (struct pair){stretch.high / e->unit, stretch.low / e->unit}, &powers);
        for (int64_t i = 0; i < n; i++) {
            struct bounded there = value_in_pairs(e, &e->series[i], &powers.own);
            high[i] = there.high, low[i] = there.low, error[i] = there.error;
        }
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

/* The state where the step begins, in as many digits as there are; "rounded": whether these are a double's. */
static bool all_digits(const struct work *w, struct pair_expansion *e, struct bounded *state, bool *rounded)
{
    *rounded = w->run->more_digits == 0 || w->run->remembered != 1;
    if (!*rounded)
        return motion_from_start(w, e, state);
    for (int64_t i = 0; i < w->run->states; i++)
        state[i] = (struct bounded){w->x[i], w->x_low[i], 0.0};
    return true;
}

/* Bernstein coefficients on [0, end] of a series, its first "zeros" terms left out. */
struct bernstein {
    int64_t degree; /* what comes after it counts for nothing in doubles */
    double noise;   /* what each coefficient may be off */
    double b[PAIR_TERMS];
};

static void bernstein_of(const struct pair_expansion *e, const struct pair_series *q, int64_t zeros, double end,
                         struct bernstein *found)
{
    int64_t degree = e->terms - 1 - zeros;
    double size = 0.0, error = 0.0, power = 1.0, scaled[PAIR_TERMS], *b = found->b;
    for (int64_t k = 0; k <= degree; k++) {
        scaled[k] = q->high[zeros + k] * power;
        size += fabs(scaled[k]), error += q->error[zeros + k] * power;
        power *= end;
    }
    for (double left_out = 0.0; degree > 2; degree--) {
        left_out += fabs(scaled[degree]);
        if (left_out > 0.5 * EPS * size)
            break;
        error += fabs(scaled[degree]);
    }
    double choices = 1.0; /* binomial coefficients; sums of products with others, as in Pascal's triangle */
    for (int64_t k = degree; k >= 0; k--) {
        double carried = scaled[k] / choices;
        for (int64_t i = 0; i <= degree - k; i++) {
            double before = i < degree - k ? b[i] : 0.0;
            b[i] = carried;
            carried += before;
        }
        choices = choices * (double)k / (double)(degree - k + 1);
    }
    found->degree = degree;
    found->noise = 4.0 * (double)(degree + 2) * EPS * size + error;
}

/* Whether a polynomial of these Bernstein coefficients is above a level. */
static bool above(const double *b, int64_t degree, double level, int64_t halvings)
{
    double lowest = INFINITY, left[PAIR_TERMS], right[PAIR_TERMS];
    for (int64_t i = 0; i <= degree; i++) {
        lowest = smaller(lowest, b[i]);
        right[i] = b[i];
    }
    if (lowest > level)
        return true;
    if (!(b[0] > level && b[degree] > level) || halvings == 0)
        return false;
    cut(left, right, degree, 0.5);
    return above(left, degree, level, halvings - 1) && above(right, degree, level, halvings - 1);
}

/* What the differences of Bernstein coefficients say: FALLING, RISING (rises), VALLEY (at one minimum), or OPEN. */
static int64_t shape_of(const double *b, int64_t degree, double noise)
{
    int64_t falling = 0, unclear = 0, rising = 0;
    for (int64_t i = 0; i < degree; i++) {
        double difference = b[i + 1] - b[i];
        if (difference > noise)
            rising += 1;
        else if (difference >= -noise)
            unclear += 1;
        else if (rising > 0)
            return OPEN;
        else
            falling += 1;
    }
    if (unclear == 0 && rising == 0)
        return FALLING;
    if (unclear == 0 && falling == 0)
        return RISING;
    return unclear <= 1 && falling > 0 && rising > 0 ? VALLEY : OPEN;
}

/* First derivatives of a series at a place, in doubles. */
static void derivatives(const struct pair_expansion *e, const struct pair_series *q, double at, double *found)
{
    found[0] = found[1] = found[2] = found[3] = 0.0;
    for (int64_t k = e->terms - 1; k >= 0; k--) {
        found[3] = fused(found[3], at, 3.0 * found[2]);
        found[2] = fused(found[2], at, 2.0 * found[1]);
        found[1] = fused(found[1], at, found[0]);
        found[0] = fused(found[0], at, q->high[k]);
    }
}

/* Zero of a derivative that changes its sign once between two places, in doubles; "rising": from below zero. */
static double sign_change(const struct pair_expansion *e, const struct pair_series *q, int order, double low,
                          double high)
{
    double at = 0.5 * (low + high), found[4], before = high - low;
    for (int step = 0; step < 60; step++) {
        derivatives(e, q, at, found);
        if ((found[order] < 0.0) == (order == 1))
            low = at;
        else
            high = at;
        double new = at - found[order] / found[order + 1];
        if (!(low < new && new < high))
            new = 0.5 * (low + high);
        double moved = fabs(new - at);
        at = new;
        if (moved <= 2.0 * EPS * at || (moved < 1e-13 * at && moved >= 0.5 * before))
            break;
        before = moved;
    }
    return at;
}

/* The root of a guard that falls next to a place: Newton's method in double-double. */
static struct near_place falling_root(const struct pair_expansion *e, const struct pair_series *q, struct pair at)
{
    for (int step = 0; step < 4; step++) {
        struct powers powers;
        powers_at(e, at, &powers);
        struct bounded height = value_in_pairs(e, q, &powers.own), slope = value_in_pairs(e, q, &powers.sloped);
        if (!(slope.high < -CLEAR * slope.error))
            break;
        double found[4], shift = -height.high / slope.high;
        derivatives(e, q, at.high, found);
        double radius = (height.error + fabs(found[2]) * shift * shift) / -slope.high;
        struct pair exact = divided((struct pair){-height.high, -height.low}, (struct pair){slope.high, slope.low});
        at = added(at, exact);
        if (radius <= KNOWN_PLACE)
            return (struct near_place){FALLING, at, 0.0};
    }
    return (struct near_place){.what = OPEN};
}

/* Whether a number is zero and known to be. */
static inline bool exact_zero(struct bounded number)
{
    return number.high == 0.0 && number.low == 0.0 && number.error == 0.0;
}

/* A guard with one minimum between two places: whether that is above zero, or else its first root. */
static struct near_place at_minimum(const struct pair_expansion *e, const struct pair_series *q, double low,
                                    double high)
{
    double about = sign_change(e, q, 1, low, high), found[4];
    struct powers powers;
    powers_at(e, (struct pair){about, 0.0}, &powers);
    struct bounded height = value_in_pairs(e, q, &powers.own), slope = value_in_pairs(e, q, &powers.sloped);
    derivatives(e, q, about, found);
    double shift = -slope.high / found[2];
    height = bounded_sum(height, exactly(0.5 * slope.high * shift));
    double error = height.error + (fabs(slope.high) * EPS + slope.error) * fabs(shift)
                   + fabs(found[3] * shift * shift * shift);
    struct pair bottom = pair_sum(about, shift);
    if (!(found[2] > 0.0 && fabs(height.high) > CLEAR * error)) {
        powers_at(e, bottom, &powers);
        bool touching = exact_zero(value_in_pairs(e, q, &powers.own)) && exact_zero(value_in_pairs(e, q, &powers.sloped));
        return (struct near_place){touching && found[2] > 0.0 ? TOUCHING : OPEN, bottom, 0.0};
    }
    if (height.high > 0.0)
        return (struct near_place){VALLEY, bottom, height.high};
    /* of the cubic about the minimum, from its parabola's root on */
    double off = -sqrt(-2.0 * height.high / found[2]);
    for (int step = 0; step < 4; step++)
        off -= (height.high + off * off * (0.5 * found[2] + off * found[3] / 6.0))
               / (off * (found[2] + 0.5 * off * found[3]));
    struct near_place root = falling_root(e, q, added(bottom, (struct pair){off, 0.0}));
    bool inside = low < root.at.high && root.at.high < about;
    root.depth = -height.high;
    return root.what == FALLING && inside ? root : (struct near_place){.what = OPEN};
}

/* What a guard does first, up to a neighbourhood of a place. */
static struct near_place near_zero(const struct pair_expansion *e, const struct pair_series *q, double suspect)
{
    for (double part = WIDEST; e->terms > 1 && part >= NARROWEST; part *= NARROWER) {
        struct bernstein whole;
        double left[PAIR_TERMS], low = suspect * (1.0 - part), high = smaller(suspect * (1.0 + part), e->reach);
        bernstein_of(e, q, 0, high, &whole);
        double *b = whole.b, noise = 2.0 * whole.noise;
        int64_t degree = whole.degree;
        cut(left, b, degree, low / high);
        int64_t shape = shape_of(b, degree, noise);
        if (shape == OPEN || !above(left, degree, noise, HALVINGS))
            continue;
        if (shape == VALLEY)
            return at_minimum(e, q, low, high);
        if (shape == FALLING && b[degree] < -noise) {
            struct near_place root = falling_root(e, q, (struct pair){sign_change(e, q, 0, low, high), 0.0});
            root.depth = -b[degree];
            return root;
        }
        double lowest = smaller(b[0], b[degree]);
        if (lowest > noise)
            return (struct near_place){RISING, {suspect, 0.0}, lowest};
    }
    return (struct near_place){.what = OPEN};
}

/* Whether a guard that is not the one in question has no event up to a place. */
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

/* How a guard's surface is left on its other side: twice the first two terms of what is away from it, there. */
struct beyond {
    struct bounded rate, bend;
};

/* That at a point on the surface; false where it is not known. */
static bool look_beyond(struct work *w, const struct pair_expansion *own, const struct guard *guard,
                        struct bounded time, const struct bounded *state, struct beyond *found)
{
    int64_t surface = guard->index, back = go_over(w, surface, guard->mode_across);
    struct pair_expansion e = {.tape = w->mode->tape, .constants = w->constants};
    e.unit = own->unit, e.reach = own->reach;
    bool there = false;
    if (make_room(&e)) {
        expand_in_pairs(&e, time, state, 3);
        for (int64_t k = 0; k < w->mode->guards; k++)
            if (is_on(&w->mode->guard[k], surface)) {
                const struct pair_series *q = series_of(&e, w->run->states + k);
                found->rate = term(q, 1);
                found->bend = e.terms > 2 ? term(q, 2) : exactly(0.0);
                there = true;
            }
        free(e.series);
    }
    go_over(w, surface, back);
    return there;
}

/* What follows at a point where a guard falls through zero, or touches it; false where two numbers do not tell.
 *
 * Where it is touched the mode goes on, and there is no change: if the other side does not lead away as well.
 */
static bool change_at(struct work *w, const struct pair_expansion *e, int64_t g, struct near_place near,
                      struct bounded time, const struct bounded *state, struct change *found)
{
    const struct guard *guard = &w->mode->guard[g];
    bool touching = near.what == TOUCHING;
    *found = (struct change){RELEASED, guard->mode_across, guard->zeros_at_release};
    if (guard->kind == VALID || guard->coupled != UNCOUPLED || guard->hold_zone != 0 || guard->jump
        || guard->mode_across < 0)
        return false;
    if (guard->kind == RELEASE)
        return found->zeros > 0;
    struct beyond away;
    if (!look_beyond(w, e, guard, time, state, &away))
        return false;
    if (touching && exact_zero(away.rate))
        return away.bend.high < -CLEAR * away.bend.error;
    double derivative[4], error = away.rate.error + KNOWN_PLACE * fabs(away.bend.high);
    derivatives(e, series_of(e, w->run->states + g), near.at.high, derivative);
    if (!(fabs(away.rate.high) > larger(CLEAR * error, TANGENT * fabs(derivative[1]))))
        return false;
    if (away.rate.high > 0.0)
        *found = (struct change){CROSSING, guard->mode_across, 1};
    else
        *found = (struct change){STICK, guard->mode_stuck, 0};
    return touching ? away.rate.high < 0.0 : found->mode >= 0;
}

/* Two doubles of a number. */
static void split(struct bounded number, double *high, double *low)
{
    *high = number.high;
    *low = fabs(number.low) > PAIR_ROUNDING * fabs(number.high) ? number.low : 0.0;
}

/* Take the step up to a place, at which the state is known. */
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

/* Go to what a guard does next to a place; UNDECIDED_EVENT where that is open. */
static int64_t settle(struct work *w, struct pair_expansion *e, int64_t g, double natural, struct bounded *state)
{
    struct run *run = w->run;
    const struct guard *guard = &w->mode->guard[g];
    bool rounded;
    if (w->known_zeros[g] > 0 || !all_digits(w, e, state, &rounded))
        return UNDECIDED_EVENT;
    double reach = EXPANDED * run->suspect;
    if (w->mode->slopes)
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
    double left = (run->horizon - end.high) + (run->horizon_low - end.low), nothing = TIME_ROUNDING * fabs(run->horizon);
    bool event = near.what == FALLING || near.what == TOUCHING, late = left < (event ? -nothing : nothing);
    struct change found;
    if (event && !late && !change_at(w, e, g, near, time, state, &found))
        return UNDECIDED_EVENT;
    step_to(w, time, state, step.high);
    leave(w);
    if (late) {
        run->time = run->horizon, run->time_low = run->horizon_low;
    } else if (near.what == FALLING) {
        int64_t index = guard->index, side = guard->side, mode = run->mode;
        go_over(w, index, found.mode);
        record_transition(w, found.kind, index, side, mode, run->mode);
        set_known_zeros(w, w->mode, index, found.zeros);
        if (events_accumulate(run))
            return EVENTS_ACCUMULATE;
    } else if (near.what != RISING) {
        w->known_zeros[g] = 2;
        if (near.what == TOUCHING && guard->kind == SURFACE) /* of a slide whose end is touched nothing is told */
            record_transition(w, GRAZE, guard->index, 0, run->mode, run->mode);
    }
    return run->stopped ? STOPPED : ON;
}

/* Decide the event at which a step was left undecided; UNDECIDED_EVENT where multiprecision has to. */
static int64_t settle_event(struct work *w, double natural)
{
    struct pair_expansion e = {.tape = w->mode->tape, .constants = w->constants};
    if (!make_room(&e))
        return UNDECIDED_EVENT;
    struct bounded *state = malloc((size_t)w->run->states * sizeof(struct bounded));
    int64_t code = state ? settle(w, &e, w->run->guard, natural, state) : UNDECIDED_EVENT;
    free(state);
    free(e.series);
    return code;
}

/* Event detection: which guard falls through zero first on a step, which guards are at zero, and the order to which a
 * guard vanishes where its surface is left (its "known zeros": 1 if left with a speed, 2 if tangentially).
 *
 * A guard is positive within its mode. On the step it is a Taylor polynomial, whose roots roots.c isolates; the
 * earliest falling root is the event. Double precision decides the event if the root is single, steep enough for
 * rounding not to matter, and no other guard has a root as early. Otherwise double-double decides (close_event.c), then
 * multiprecision.
 */

/* Relative steepness of a guard at its root below which double precision does not decide the event. */
#define UNDECIDED_STEEPNESS 1e-5
/* A guard whose minimum is within this many tolerances of zero, relative to its size on the step, may touch zero or
 * not: multiprecision decides. */
#define NEAR 1e3
/* Minimum of a guard on a step: steps of Newton's method, and number of places from which the start is chosen. */
#define TOUCH_STEPS 6
#define TOUCH_PLACES 16
/* A force that differs from the friction by no more than this part of the friction equals it. */
#define EQUAL_PART 1e-13
/* A constant held load exceeds its limit by no more than this many tolerances of the friction (1.8 were measured after
 * 20,000 s at a tolerance of 1e-4, where the load follows from an oscillation whose error grows). */
#define HELD_TOLERANCES 10

/* An event on a step. */
struct event {
    double part;     /* part of the step up to the event; 2 if there is none */
    int64_t guard;   /* -1 if there is no event */
    bool undecided;  /* whether double precision does not decide the event */
    int64_t landing; /* method used (enum landing) */
};

/* Place on (0, 1) of a positive polynomial's minimum, if that is within "level" of the polynomial's size; else -1. */
static double near_touch(const double *a, int64_t degree, double level)
{
    double size = 0.0, tau = -1.0, lowest = INFINITY;
    for (int64_t k = 0; k <= degree; k++)
        size += fabs(a[k]);
    for (int place = 1; place < TOUCH_PLACES; place++) {
        double at = (double)place / TOUCH_PLACES, height = value(a, degree, at);
        if (height < lowest)
            lowest = height, tau = at;
    }
    double first = tau, before = -1.0;
    for (int step = 0; step < TOUCH_STEPS && tau != before; step++) {
        before = tau;
        double slope = 0.0, bend = 0.0;
        for (int64_t k = degree; k > 0; k--) {
            bend = bend * tau + slope;
            slope = slope * tau + (double)k * a[k];
        }
        if (!(bend > 0.0))
            return -1.0;
        tau -= slope / bend;
        if (!(fabs(tau - first) < 2.0 / TOUCH_PLACES))
            return -1.0;
    }
    return 0.0 < tau && tau < 1.0 && value(a, degree, tau) <= level * size ? tau : -1.0;
}

/* Check whether a guard is the end of a slide and the force equals the friction on a whole step: the slide holds.
 *
 * A held load that does not change on the step may exceed its limit by what the tolerance explains.
 * The guard is compared with the sum of all guards that end the slide, which has the size of the friction. "natural" is
 * theta of the uncut step: on a shortened step any guard next to zero would stay there.
 */
static bool load_equals_friction(const struct work *w, int64_t guard, double natural)
{
    const struct guard *guards = w->mode->guard, *end = &guards[guard];
    if (end->kind != RELEASE)
        return false;
    double friction = 0.0;
    for (int64_t g = 0; g < w->mode->guards; g++)
        if (guards[g].kind == RELEASE && guards[g].index == end->index)
            friction += guard_row(w, g)[0];
    const double *row = guard_row(w, guard);
    double own = end->held ? 0.0 : fabs(row[0]), power = natural;
    if (end->held && !(fabs(row[0]) <= (EQUAL_PART + HELD_TOLERANCES * w->run->tolerance) * friction))
        return false;
    for (int64_t k = 1; k <= w->run->order; k++) {
        own += fabs(row[k]) * power;
        if (!(own <= EQUAL_PART * friction))
            return false;
        power *= natural;
    }
    return true;
}

/* First root of one guard on a step: its place and the landing used; part 2 if there is none.
 *
 * "powers" holds those of the step's theta. "level": a minimum within this part of the guard's size is left to
 * multiprecision; 0: none is. "begin": place of the root; for a touch, the start of the piece that contains it.
 */
static inline struct event root_of_guard(const struct work *w, int64_t g, double natural, double level, double *begin)
{
    struct run *run = w->run;
    const double *row = guard_row(w, g);
    int64_t order = run->order, zeros = w->known_zeros[g], degree = order - zeros;
    const double *q = row + zeros;
    double *factor = w->stack + w->width, *quotient = factor + w->width; /* rows that are free until the first cut */
    struct event found = {2.0, -1, false, 0};
    if (zeros > 0) {
        if (q[0] > 0.0 && positive_by_bound(q, w->powers, degree))
            return found;
        if (deflated(row, zeros, order, factor, quotient))
            q = quotient;
    }
    struct first_root root = {w->mode->bernstein(q, w->powers, degree, w->scaled, w->stack), 0.0, 1.0};
    if (root.outcome == SUBDIVIDE) {
        root = first_falling_root(w->scaled, order, w->stack, w->width);
        if (root.outcome == NO_ROOT && level > 0.0) {
            root.low = root.high = near_touch(w->scaled, degree, level);
            root.outcome = root.low > 0.0 ? TANGENTIAL : NO_ROOT;
        }
    }
    if (root.outcome == NO_ROOT || load_equals_friction(w, g, natural))
        return found;
    if (root.outcome == TANGENTIAL) {
        *begin = root.low;
        return (struct event){0.5 * (root.low + root.high), g, true, BRACKET};
    }
    struct landed landed = {-1.0, BRENT, 0};
    if (run->method == BRENT)
        landed = brent(w->scaled, degree, root.low, root.high);
    if (landed.tau < 0.0)
        landed = land(w->scaled, degree, root.low, root.high, run->method);
    run->guard_evaluations += landed.evaluations;
    *begin = landed.tau;
    return (struct event){landed.tau, g, false, landed.used};
}

/* Earliest event on (0, theta].
 *
 * "Faint" guards are skipped. "natural": theta of the uncut step.
 */
static inline struct event first_event(struct work *w, double theta, double natural)
{
    const struct run *run = w->run;
    struct event first = {2.0, -1, false, 0};
    double earliest = 2.0; /* place of the earliest root, or start of the piece that contains a touch */
    double level = run->more_digits != 0 && run->remembered == 1 ? NEAR * run->tolerance : 0.0;
    bool powers_made = false;
    for (int64_t g = 0; g < w->mode->guards; g++) {
        if (w->faint[g] != 0 || (w->known_zeros[g] == 0 && w->lower[g] > 0.0))
            continue;
        if (!powers_made)
            powers_of(theta, w->powers, run->order);
        powers_made = true;
        double begin = 2.0;
        struct event found = root_of_guard(w, g, natural, level, &begin);
        if (begin < earliest) {
            if (!found.undecided) {
                double steep = steepness(w->scaled, run->order - w->known_zeros[g], found.part, w->stack);
                found.undecided = steep < UNDECIDED_STEEPNESS || steep * steep < level;
            }
            earliest = begin, first = found;
        }
    }
    return first;
}

/* Order to which a guard <= 0 vanishes at the start of a step if its surface is being left there; 0 if it is not.
 *
 * "surface": the guard may be that of a surface being left. "fails": the guard is below zero and its surface is not
 * being left, so that the mode is not consistent. The side of a surface was decided when the surface was left, and no
 * root followed, so a value below zero is rounding (another event followed at once): if the guard rises, with a speed
 * or tangentially, nothing needs a decision. A guard that is zero and stays zero fails, too, perhaps through rounding.
 */
static int64_t below_zero(const double *row, int64_t order, bool surface, bool *fails)
{
    double size = 0.0;
    for (int64_t k = 1; k <= order; k++)
        size += fabs(row[k]);
    *fails = false;
    if (surface && row[1] > TANGENT * size)
        return 1;
    if (surface && fabs(row[1]) <= TANGENT * size && row[2] > 0.5 * size)
        return 2;
    *fails = true;
    return 0;
}

/* Check whether a guard is below zero where the step begins, its surface not being left; sets these guards' "hits". */
static inline bool guards_below_zero(struct work *w, double natural)
{
    bool found = false;
    for (int64_t g = 0; g < w->mode->guards; g++) {
        const struct guard *guard = &w->mode->guard[g];
        const double *row = guard_row(w, g);
        w->hits[g] = 0;
        if (row[w->known_zeros[g]] <= 0.0 && guard->rising_only == 0) {
            bool fails, surface = w->known_zeros[g] == 0 && guard->kind == SURFACE;
            int64_t zeros = below_zero(row, w->run->order, surface, &fails);
            fails = fails && !load_equals_friction(w, g, natural);
            w->known_zeros[g] += zeros;
            w->hits[g] = fails ? 1 : 0;
            found = found || fails;
        }
    }
    return found;
}

/* Check whether a guard is at zero, within rounding, at tau, where another guard has its event. */
static inline bool at_zero(const struct work *w, int64_t g, double tau)
{
    int64_t degree = w->run->order - w->known_zeros[g];
    const double *q = guard_row(w, g) + w->known_zeros[g];
    if (w->mode->guard[g].rising_only && q[0] < 0.0)
        return false;
    double size = 0.0, power = 1.0;
    for (int64_t k = 0; k <= degree; k++) {
        size += fabs(q[k]) * power;
        power *= tau;
    }
    return size > 0.0 && value(q, degree, tau) <= 32.0 * EPS * size;
}

/* Check by the bound b of a guard on a step, its first term a > 0 plus its negative terms, that it is not at zero at
 * the step's end. The terms' sizes add up to the value there, b at least, and 2 (a - b): the value exceeds the rounding
 * of at_zero if b exceeds about twice that part of a. */
static inline bool above_zero_by_bound(const struct work *w, int64_t g)
{
    return w->known_zeros[g] == 0 && w->lower[g] > 1e3 * EPS * guard_row(w, g)[0];
}

/* Check whether a guard falls to zero, within rounding, at the end of a step. */
static bool ends_at_zero(const struct work *w, int64_t g, double theta)
{
    const double *row = guard_row(w, g);
    if (row[w->known_zeros[g]] <= 0.0 || !at_zero(w, g, theta))
        return false;
    double slope = 0.0, power = 1.0;
    for (int64_t k = 1; k <= w->run->order; k++) {
        slope += (double)k * row[k] * power;
        power *= theta;
    }
    return slope < 0.0;
}

/* 1 if the surface is left with a speed, 2 if tangentially, 0 if the new mode's field points back at it.
 *
 * speeds: for each guard of the mode the normal velocity towards its surface, and away from the surface beyond it.
 */
static int64_t zeros_at_release(const struct mode *mode, int64_t surface, const double *speeds)
{
    for (int64_t g = 0; g < mode->guards; g++)
        if (is_on(&mode->guard[g], surface)) {
            double towards = speeds[2 * g], beyond = speeds[2 * g + 1];
            if (fabs(towards) <= TANGENT * (fabs(towards) + fabs(beyond)))
                return 2;
            return towards < 0.0 ? 1 : 0;
        }
    return 0;
}

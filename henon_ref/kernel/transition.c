/* The mode after an event: of one guard, by two normal velocities or the hold zone; and of kinks that are crossed at
 * the same instant, or beside what is slid on.
 *
 * At a kink (struct guard) nothing slides. So the mode in which all kinks are crossed is expanded where the run stands:
 * each kink must be left there with a speed, and the ends of all slides must be clearly above zero, for then they go on.
 * What else falls at the instant is decided in that mode, as it would be just behind the kinks: the end of a slide by
 * the way in which its guard goes on, a surface by its normal velocities. The mode that comes of it is expanded, too,
 * for a force that jumps may turn the speed of a kink. What is not clear is left to Python.
 */

static int64_t change_entries(struct work *w);

/* Size of the smallest release guard, relative to all their coefficients, below which Python looks closer. */
#define HOLD_MARGIN 1e-9

/* Normal velocities of the guards of the present mode, where the run stands. */
static const double *speeds_at(struct work *w)
{
    const struct run *run = w->run;
    const double *constants = w->constants + w->tables->length;
    w->mode->normal_velocities(run->time, run->time_low, 1.0, w->x, constants, w->speeds);
    return w->speeds + run->states;
}

/* Those of the mode in a row; counted. */
static const double *speeds_in(struct work *w, int64_t row)
{
    struct run *run = w->run;
    const double *constants = constants_of(w->tables, row, 1);
    mode_at(w, row)->normal_velocities(run->time, run->time_low, 1.0, w->x, constants, w->speeds);
    run->expansions += 1;
    return w->speeds + run->states;
}

/* +1 inside the hold zone of a surface, -1 outside, 0 where that is not clear; "stick": row of the mode that slides on
 * it. */
static int64_t inside_hold_zone(struct work *w, int64_t surface, int64_t stick)
{
    const struct run *run = w->run;
    int64_t back = go_over(w, surface, stick);
    const struct mode *mode = w->mode;
    mode->expansion(run->time, run->time_low, run->unit, w->x, w->constants, w->ahead);
    double lowest = 1e300, size = 0.0;
    for (int64_t g = 0; g < mode->guards; g++)
        if (mode->guard[g].kind == RELEASE && mode->guard[g].index == surface) {
            const double *row = row_ahead(w, run->states + g);
            lowest = smaller(lowest, row[0]);
            for (int64_t k = 0; k <= run->order; k++)
                size += fabs(row[k]);
        }
    go_over(w, surface, back);
    if (!(fabs(lowest) > HOLD_MARGIN * size))
        return 0;
    return lowest > 0.0 ? 1 : -1;
}

/* What follows an event of one guard. */
struct change {
    int64_t kind;  /* of transition */
    int64_t mode;  /* row of the mode; -1 where it is not compiled */
    int64_t zeros; /* with which the surface is left; 0 at a release: to be measured */
};

/* Whether no guard of a mode that ends the run, as where its sliding does not attract, is close to zero here. */
static bool goes_on(const struct work *w, int64_t row)
{
    const struct run *run = w->run;
    const struct mode *mode = mode_at(w, row);
    bool expanded = false;
    for (int64_t g = 0; g < mode->guards; g++) {
        if (mode->guard[g].kind != VALID)
            continue;
        if (!expanded)
            mode->expansion(run->time, run->time_low, run->unit, w->x, constants_of(w->tables, row, 0), w->ahead);
        expanded = true;
        const double *values = row_ahead(w, run->states + g);
        double size = 0.0;
        for (int64_t k = 0; k <= run->order; k++)
            size += fabs(values[k]);
        if (!(values[0] > CLEAR_MARGIN * size))
            return false;
    }
    return true;
}

/* Go over to the mode that several surfaces lead to; ON, or why Python is needed. */
static int64_t apply_selection(struct work *w)
{
    const struct selection *selection = &w->tables->selection;
    int64_t target, number = UNCLEAR;
    if (!selection->velocities)
        return SELECT_MODE;
    if (selection->contact) {
        number = mode_of_contacts(w);
        target = number < 0 ? UNCLEAR : row_of_number(w, number);
    } else {
        target = select_mode(w);
    }
    if (target < 0 && number >= 0)
        return not_compiled(w->run, SELECTED, number);
    if (target < 0 || !goes_on(w, target) || !change_mode(w, target))
        return SELECT_MODE;
    return events_accumulate(w->run) ? EVENTS_ACCUMULATE : ON;
}

/* Whether a surface is never left on the other side of a guard of a mode, no force acting there: all derivatives of its
 * function are zeros in doubles. */
static bool never_left(struct work *w, const struct guard *guard)
{
    const struct run *run = w->run;
    int64_t index = guard->index, row = guard->mode_across;
    if (row < 0 || guard->mode_stuck < 0)
        return false;
    int64_t back = go_over(w, index, row);
    w->mode->expansion(run->time, run->time_low, run->unit, w->x, w->constants, w->ahead);
    const double *ahead = row_ahead(w, run->states + guard_on(w->mode, index));
    bool found = true;
    for (int64_t k = 1; k <= run->order; k++)
        found = found && ahead[k] == 0.0;
    go_over(w, index, back);
    return found;
}

/* What follows where the surface h of a guard of a mode is reached alone, from the side s (Filippov, 1988, Sec. 4):
 * inside = -s h'(s) is the speed towards it, beyond = -s h'(-s) that away from it on the other side. Sliding where
 * inside > 0 > beyond, crossing where both are > 0; a hold zone decides instead. ON, or why Python is needed. */
static int64_t at_surface(struct work *w, const struct mode *mode, int64_t g, const double *speeds,
                          struct change *found)
{
    const struct guard *guard = &mode->guard[g];
    double inside = speeds[2 * g], beyond = speeds[2 * g + 1];
    bool still = beyond == 0.0 && guard->hold_zone == 0 && never_left(w, guard); /* the limit of sliding */
    if (!(inside > 0.0 && (still || fabs(beyond) > TANGENT * inside)))
        return SELECT_MODE;
    bool stuck = still || beyond < 0.0;
    if (guard->hold_zone == 1) {
        int64_t stick = guard->mode_stuck, zone = stick < 0 ? 0 : inside_hold_zone(w, guard->index, stick);
        if (zone == 0 || (stuck && zone < 0))
            return SELECT_MODE;
        stuck = zone > 0;
    }
    *found = stuck ? (struct change){STICK, guard->mode_stuck, 0} : (struct change){CROSSING, guard->mode_across, 1};
    return ON;
}

/* Expand the mode in a row where the run stands; the part of the unit on which its terms fall, 0 where not finite. */
static double expand_mode(struct work *w, int64_t row)
{
    struct run *run = w->run;
    const struct mode *mode = mode_at(w, row);
    mode->expansion(run->time, run->time_low, run->unit, w->x, constants_of(w->tables, row, 0), w->ahead);
    run->expansions += 1;
    return length_ahead(w, run->states + mode->guards);
}

/* Zeros with which a surface is left in the mode that is expanded, on a length, from "first" on: the first coefficient
 * that is clearly none; 0 where the surface is not left, or that is not clear. */
static int64_t zeros_ahead(const struct work *w, const struct mode *mode, int64_t surface, int64_t first, double length)
{
    int64_t order = w->run->order;
    const double *row = row_ahead(w, w->run->states + guard_on(mode, surface));
    double size = size_of_terms(row, 0, order, length), power = 1.0;
    for (int64_t k = 1; k <= order; k++) {
        power *= length;
        if (k >= first && fabs(row[k]) * power > CLEARLY_ABOVE * size)
            return row[k] > 0.0 ? k : 0;
    }
    return 0;
}

/* The row of a mode: the guard's link (mode_across, mode_stuck) if it has one, else looked up by the mode's number. */
static int64_t known_row(const struct work *w, int64_t link, int64_t number)
{
    return link >= 0 || w->mode->surfaces == 0 ? link : row_of_number(w, number);
}

/* What happens at one instant. */
struct instant {
    int64_t kinks;  /* how many are crossed */
    int64_t other;  /* guard of the mode that falls beside them; -1: none */
    int64_t number; /* of the mode in which all kinks are crossed, and nothing else is changed */
    int64_t row;    /* its row */
};

/* Whether a surface is among the kinks that are crossed. */
static bool is_crossed(const struct work *w, int64_t surface)
{
    bool found = false;
    for (int64_t g = 0; g < w->mode->guards; g++)
        found = found || (w->hits[g] == 1 && w->mode->guard[g].kink && is_on(&w->mode->guard[g], surface));
    return found;
}

/* Read off what happens; false where it is more than kinks and one guard that is decided alone. */
static bool read_instant(const struct work *w, struct instant *at)
{
    *at = (struct instant){0, -1, w->mode->number, -1};
    for (int64_t g = 0; g < w->mode->guards; g++) {
        const struct guard *guard = &w->mode->guard[g];
        if (w->hits[g] == 0)
            continue;
        if (guard->kink) {
            at->kinks += 1;
            at->row = at->kinks == 1 ? guard->mode_across : -1;
            at->number += (guard->to_sign - guard->side) * three_to(guard->index);
        } else if (at->other >= 0 || guard->kind == VALID || guard->coupled != UNCOUPLED) {
            return false;
        } else {
            at->other = g;
        }
    }
    at->row = known_row(w, at->row, at->number);
    return at->kinks > 0;
}

/* Expand the mode in a row; whether it leaves all kinks behind with a speed and its slides go on, all but one at most,
 * which "ending" names: the guard that ends it. One that a force ends which jumps at the kinks is put there; -1: none.
 * "length": see expand_mode. */
static bool kinks_behind(struct work *w, int64_t row, int64_t *ending, double *length)
{
    const struct mode *mode = mode_at(w, row);
    *length = expand_mode(w, row);
    bool behind = *length > 0.0;
    for (int64_t g = 0; behind && g < mode->guards; g++) {
        const struct guard *guard = &mode->guard[g];
        const double *ahead = row_ahead(w, w->run->states + g);
        double margin = CLEARLY_ABOVE * size_of_terms(ahead, 0, w->run->order, *length);
        bool ends = guard->kind == RELEASE && guard->coupled == UNCOUPLED && ahead[0] < -margin && *ending < 0;
        if (ends)
            *ending = g;
        else if (guard->kind == SURFACE)
            behind = !(guard->kink && is_crossed(w, guard->index)) || ahead[1] * *length > margin;
        else
            behind = g == *ending || ahead[0] > margin;
    }
    return behind;
}

/* Whether a guard, if there is one, is the same in the mode of a row: modes with the same slides have their guards in
 * one order. */
static bool same_guard(const struct work *w, int64_t row, int64_t g)
{
    const struct mode *mode = mode_at(w, row);
    if (g < 0)
        return true;
    const struct guard *one = &w->mode->guard[g], *other = &mode->guard[g];
    return g < mode->guards && one->kind == other->kind && one->index == other->index;
}

/* What becomes of a slide whose end has come with kinks, in the mode behind these, which is expanded on a length; ON, or
 * why Python is needed. Its kind is GRAZE where the slide goes on: an equivalent sign that turns back. (A load that has
 * come to its limit has slipped.) */
static int64_t at_end_of_slide(const struct work *w, const struct instant *at, double length, struct change *found)
{
    const struct run *run = w->run;
    const struct guard *guard = &mode_at(w, at->row)->guard[at->other];
    const double *row = row_ahead(w, run->states + at->other);
    double margin = CLEARLY_ABOVE * size_of_terms(row, 0, run->order, length);
    bool jumped = fabs(row[0]) > margin;
    double way = guard->rising_only ? -INFINITY : jumped ? row[0] : row[1] * length;
    if (!(fabs(way) > margin))
        return SELECT_MODE;
    *found = way > 0.0 ? (struct change){GRAZE, at->row, jumped ? 0 : 1}
                       : (struct change){RELEASED, guard->mode_across, jumped ? 1 : guard->zeros_at_release};
    return ON;
}

/* Go over to the mode that follows kinks, and what happens beside them; ON, or why the loop is left. */
static int64_t leave_instant(struct work *w, const struct instant *at, const struct change *found)
{
    struct run *run = w->run;
    const struct mode *target = mode_at(w, found->mode);
    const struct guard *other = at->other < 0 ? NULL : &w->mode->guard[at->other];
    bool told = other && found->kind != GRAZE;
    int64_t changes = at->kinks + (told ? 1 : 0), last = -1;
    if (run->transitions > 0 && run->transitions + changes > run->transition_capacity) {
        run->event_pending = 1;
        return BLOCK_FULL;
    }
    for (int64_t k = 0; k < changes; k++) { /* in the order of the surfaces */
        const struct guard *next = NULL;
        for (int64_t g = 0; g < w->mode->guards; g++) {
            const struct guard *guard = &w->mode->guard[g];
            bool changes_side = (w->hits[g] == 1 && guard->kink) || (told && g == at->other);
            if (changes_side && guard->index > last && !(next && next->index < guard->index))
                next = guard;
        }
        record_transition(w, next == other ? found->kind : CROSSING, next->index, next->side, run->mode, found->mode);
        last = next->index;
    }
    for (int64_t g = 0; g < target->guards; g++) {
        const struct guard *guard = &target->guard[g];
        bool crossed = guard->kink && guard->kind == SURFACE && is_crossed(w, guard->index);
        bool own = told ? is_on(guard, other->index) : other && g == at->other;
        w->known_zeros[g] = crossed ? 1 : own ? found->zeros : 0;
    }
    run->mode = found->mode;
    return events_accumulate(run) ? EVENTS_ACCUMULATE : ON;
}

/* Change the mode where kinks are crossed, and at most one other guard falls; ON, or why Python is needed. */
static int64_t cross_kinks(struct work *w)
{
    struct run *run = w->run;
    struct instant at;
    double length;
    if (!read_instant(w, &at))
        return SELECT_MODE;
    bool numbered = w->mode->surfaces > 0;
    if (at.row < 0)
        return numbered ? not_compiled(run, CROSSING, at.number) : SELECT_MODE;
    if (!kinks_behind(w, at.row, &at.other, &length) || !same_guard(w, at.row, at.other))
        return SELECT_MODE;
    struct change found = {CROSSING, at.row, 0};
    if (at.other >= 0) {
        const struct guard *guard = &w->mode->guard[at.other];
        const struct mode *behind = mode_at(w, at.row);
        int64_t code = guard->kind == RELEASE
                           ? at_end_of_slide(w, &at, length, &found)
                           : at_surface(w, behind, guard_on(behind, guard->index), speeds_in(w, at.row), &found);
        if (code != ON)
            return code;
        int64_t entry = found.kind == STICK ? 0 : guard->to_sign;
        int64_t number = at.number + (entry - guard->side) * three_to(guard->index);
        found.mode = known_row(w, found.mode, number);
        if (found.mode < 0)
            return numbered ? not_compiled(run, found.kind, number) : SELECT_MODE;
        int64_t ending = -1;
        if (found.kind != GRAZE && !(kinks_behind(w, found.mode, &ending, &length) && ending < 0))
            return SELECT_MODE;
        if (found.kind == RELEASED)
            found.zeros = zeros_ahead(w, mode_at(w, found.mode), guard->index, found.zeros, length);
        if (found.kind == RELEASED && found.zeros == 0)
            return SELECT_MODE;
    }
    return leave_instant(w, &at, &found);
}

/* Whether the one thing that happens is that a surface which is slid on turns repelling, the fields on both sides at
 * once (a two-fold; Filippov, 1988, Sec. 19): the ends of the slide fall together, and both slips leave the surface. */
static bool turns_repelling(struct work *w)
{
    const struct mode *mode = w->mode;
    int64_t index = mode->guard[w->run->guard].index, ends = 0;
    for (int64_t g = 0; g < mode->guards; g++) {
        const struct guard *guard = &mode->guard[g];
        if (guard->kind != RELEASE && w->hits[g] == 0)
            continue;
        if (w->words || w->hits[g] == 0 || guard->kind != RELEASE || guard->index != index
            || guard->zeros_at_release != 2 || guard->mode_across < 0)
            return false;
        double length = expand_mode(w, guard->mode_across);
        if (!(length > 0.0) || zeros_ahead(w, mode_at(w, guard->mode_across), index, 1, length) == 0)
            return false;
        ends += 1;
    }
    return ends == 2;
}

/* Change the mode at the event the run stands at; ON, or why Python is needed. */
static int64_t apply_event(struct work *w)
{
    struct run *run = w->run;
    const struct guard *guard = &w->mode->guard[run->guard];
    bool coincident = false;
    leave(w);
    for (int64_t g = 0; g < w->mode->guards; g++)
        coincident = coincident || (w->hits[g] == 1 && g != run->guard);
    if (guard->kind == VALID)
        return LEFT_DOMAIN;
    if (w->words && (coincident || guard->coupled != UNCOUPLED))
        return change_entries(w);
    if (guard->jump && !coincident)
        return jump_transition(w);
    if (coincident && turns_repelling(w))
        return NOT_UNIQUE;
    if (coincident || guard->coupled != UNCOUPLED) {
        int64_t code = apply_selection(w);
        return code == SELECT_MODE ? cross_kinks(w) : code;
    }
    struct change found = {RELEASED, guard->mode_across, guard->zeros_at_release};
    if (guard->kind == SURFACE) {
        run->expansions += 1;
        int64_t code = at_surface(w, w->mode, run->guard, speeds_at(w), &found);
        if (code != ON)
            return code;
    }
    if (found.mode < 0) {
        run->pending_kind = found.kind, run->pending_mode = -1;
        return MODE_NOT_COMPILED;
    }
    int64_t index = guard->index, side = guard->side, mode = run->mode;
    int64_t back = go_over(w, index, found.mode);
    if (found.kind == RELEASED && found.zeros < 0) {
        found.zeros = zeros_ahead(w, w->mode, index, 1, expand_mode(w, run->mode));
    } else if (found.kind == RELEASED && found.zeros == 0) {
        run->expansions += 1;
        found.zeros = zeros_at_release(w->mode, index, speeds_at(w));
    }
    if (found.kind == RELEASED && found.zeros == 0) {
        go_over(w, index, back);
        return SELECT_MODE;
    }
    record_transition(w, found.kind, index, side, mode, run->mode);
    set_known_zeros(w, w->mode, index, found.zeros);
    return events_accumulate(run) ? EVENTS_ACCUMULATE : ON;
}

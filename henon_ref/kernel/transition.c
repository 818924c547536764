/* The mode after an event: of one guard, by two normal velocities or the hold zone; of kinks crossed at the same
 * instant or while the mode slides.
 *
 * No mode slides on a kink (struct guard). So the mode in which all kinks are crossed is expanded at the present point:
 * each kink must be left with a speed, and the guards that end slides must be clearly above zero, so that these slides
 * continue. A further guard that falls at the same instant is decided in that mode, as if it fell just after the
 * kinks: the end of a slide by the value or the derivative of its guard, a surface by its normal velocities. The
 * resulting mode is expanded, too, because a force that jumps may reverse the speed at which a kink is left. Python
 * decides all other cases.
 */

static int64_t change_entries(struct work *w);

/* A hold zone is clear if the smallest release guard exceeds this part of all their coefficients' sizes. */
#define HOLD_MARGIN 1e-9

/* Normal velocities of the guards of the present mode at the present point. */
static const double *speeds_at(struct work *w)
{
    const struct run *run = w->run;
    const double *constants = w->constants + w->tables->length;
    w->mode->normal_velocities(run->time, run->time_low, 1.0, w->x, constants, w->speeds);
    return w->speeds + run->states;
}

/* Normal velocities of the guards of the mode in a row; counted as an expansion. */
static const double *speeds_in(struct work *w, int64_t row)
{
    struct run *run = w->run;
    const double *constants = constants_of(w->tables, row, 1);
    mode_at(w, row)->normal_velocities(run->time, run->time_low, 1.0, w->x, constants, w->speeds);
    run->expansions += 1;
    return w->speeds + run->states;
}

/* +1 inside the hold zone of a surface, -1 outside, 0 if not clear; "stick": row of the mode that slides on the
 * surface. */
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

/* Result of an event of one guard. */
struct change {
    int64_t kind;  /* enum transition_kind */
    int64_t mode;  /* row of the mode; -1 if it is not compiled */
    int64_t zeros; /* known zeros with which the surface is left; 0 at a release: still to be determined */
};

/* Check whether all guards of a mode that would end the run (such as "attracts") are clearly above zero. */
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

/* Enter the mode selected for several surfaces; ON, or the reason why Python is needed. */
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

/* Check whether a surface is never left on the other side of a guard because no force acts there: all derivatives of
 * its function are zero in doubles. */
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

/* Decide an event of one surface h, reached from the side s (Filippov, 1988, Sec. 4). inside = -s h'(s) is the speed
 * towards the surface, beyond = -s h'(-s) the speed away from it on the other side. Sliding if inside > 0 > beyond,
 * crossing if both are > 0; a hold zone takes precedence. ON, or the reason why Python is needed. */
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

/* Expand the mode in a row at the present point; the part of the unit on which its terms decrease, 0 if not finite. */
static double expand_mode(struct work *w, int64_t row)
{
    struct run *run = w->run;
    const struct mode *mode = mode_at(w, row);
    mode->expansion(run->time, run->time_low, run->unit, w->x, constants_of(w->tables, row, 0), w->ahead);
    run->expansions += 1;
    return length_ahead(w, run->states + mode->guards);
}

/* Known zeros with which a surface is left in the expanded mode, on a length: order >= "first" of the first coefficient
 * that is clearly not zero; 0 if the surface is not left, or that is not clear. */
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

/* Row of a mode: the guard's link (mode_across, mode_stuck) if it has one, else looked up by the mode's number. */
static int64_t known_row(const struct work *w, int64_t link, int64_t number)
{
    return link >= 0 || w->mode->surfaces == 0 ? link : row_of_number(w, number);
}

/* Guards at zero at one instant. */
struct instant {
    int64_t kinks;  /* number of kinks crossed */
    int64_t other;  /* other guard of the mode that falls; -1: none */
    int64_t number; /* number of the mode in which all kinks are crossed, and nothing else is changed */
    int64_t row;    /* row of that mode */
};

/* Check whether a surface is a kink that is crossed. */
static bool is_crossed(const struct work *w, int64_t surface)
{
    bool found = false;
    for (int64_t g = 0; g < w->mode->guards; g++)
        found = found || (w->hits[g] == 1 && w->mode->guard[g].kink && is_on(&w->mode->guard[g], surface));
    return found;
}

/* Collect the guards at zero; false if they are not kinks and at most one guard that is decided alone. */
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

/* Expand the mode in a row; check whether it leaves all kinks with a speed and continues all slides except the one that
 * guard "ending" ends (-1: none). If "ending" is -1, it is set to the end of one slide that a jump of a force at the
 * kinks has put below zero. "length": see expand_mode. */
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

/* Check whether a guard, if there is one, has the same index in the mode of a row: modes with the same slides have
 * their guards in the same order. */
static bool same_guard(const struct work *w, int64_t row, int64_t g)
{
    const struct mode *mode = mode_at(w, row);
    if (g < 0)
        return true;
    const struct guard *one = &w->mode->guard[g], *other = &mode->guard[g];
    return g < mode->guards && one->kind == other->kind && one->index == other->index;
}

/* Decide a slide whose end coincides with kinks, in the expanded mode after the kinks; ON, or the reason why Python is
 * needed. Kind GRAZE if the slide continues because its equivalent sign turns back. (The release condition of a
 * sliding override is an event and releases at once.) */
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

/* Enter the mode after the kinks and the other guard, and record the transitions; ON, or the reason to leave the
 * loop. */
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

/* Change the mode where kinks are crossed and at most one other guard falls; ON, or the reason why Python is needed. */
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

/* Check whether the only event is that a surface on which the mode slides turns repelling, the fields on both sides at
 * once (a two-fold; Filippov, 1988, Sec. 19): both ends of the slide fall, and both slips leave the surface. */
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

/* Change the mode at the present event; ON, or the reason why Python is needed. */
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

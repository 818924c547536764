/* Runs of many points in one call, without Python or its interpreter lock.
 *
 * A point is set aside, by its number, if double precision cannot decide it, if it needs a mode that is not compiled,
 * or if its run ends before the horizon: Python finishes it (henon_ref/integrator/points.py).
 *
 * Several runs are in progress at once, in slots. Their expansions are about half of the work. LANES of them are
 * computed at once, in the lanes of vectors, if the runs have the same code; the run then takes its step as it would
 * alone, so that all bits are those of the run alone.
 */

/* Place of the transition in a row of the buffer, in doubles: after the number of the point. */
#define KEPT_PLACE 1

static void append(struct slot *slot, const double *transition, int64_t width)
{
    double *row = slot->kept + slot->filled * width;
    memcpy(row, &slot->point, sizeof slot->point);
    memcpy(row + KEPT_PLACE, transition, (size_t)(width - KEPT_PLACE) * sizeof(double));
    slot->filled += 1;
}

/* Append transitions of the present point to the buffer, except those before points->after.
 *
 * The buffer has room for "count" of them and one per surface.
 */
HENON_EXPORT void keep_transitions(struct slot *slot, const struct points *points, const double *records,
                                   int64_t count)
{
    int64_t width = points->width;
    for (int64_t k = 0; k < count; k++) {
        const double *record = records + k * (width - KEPT_PLACE);
        struct transition made;
        memcpy(&made, record, sizeof made);
        double *waiting = slot->pending + made.surface * width;
        if (made.time < points->after) {
            if (points->open_sticks != 0 && (made.kind == STICK || made.kind == RELEASED)) {
                waiting[0] = made.kind == STICK ? 1.0 : 0.0;
                memcpy(waiting + KEPT_PLACE, record, (size_t)(width - KEPT_PLACE) * sizeof(double));
            }
            continue;
        }
        if (made.kind == RELEASED && waiting[0] != 0.0) {
            append(slot, waiting + KEPT_PLACE, width);
            waiting[0] = 0.0;
        }
        append(slot, record, width);
    }
}

/* Mode of a point: its row, or its words. */
static inline int64_t *mode_of_point(const struct points *points, const struct run *run, int64_t point)
{
    int64_t words = words_of(run->contacts);
    return points->rows + point * (words ? words : 1);
}

/* The compiled modes for the parameters of a point; "tables": for those of the first point. */
static inline struct tables tables_of_point(const struct tables *tables, const struct points *points, int64_t point)
{
    struct tables own = *tables;
    own.numbers += point * points->numbers_step;
    own.selection.constants += own.selection.constants ? point * points->numbers_step : 0;
    return own;
}

/* Store the end of a point's run. */
static void finish_point(const struct points *points, const struct slot *slot, int64_t code)
{
    const struct run *run = (const struct run *)slot->block;
    const struct places p = places_of_run(run);
    struct end *end = points->ends + slot->point;
    end->time = run->time, end->time_low = run->time_low, end->code = code, end->mode = run->mode;
    end->steps = run->steps, end->expansions = run->expansions, end->guard_evaluations = run->guard_evaluations;
    memcpy(mode_of_point(points, run, slot->point), slot->block + p.entries,
           (size_t)words_of(run->contacts) * sizeof(double));
    memcpy(points->states + slot->point * run->states, slot->block + p.state, (size_t)run->states * sizeof(double));
}

/* Store the result of a call of the loop; return whether the point's run continues. */
static bool take_in(struct slot *slot, const struct points *points, int64_t code)
{
    struct run *run = (struct run *)slot->block;
    bool spent = code == BUDGET_SPENT, going_on = code == BLOCK_FULL || (spent && run->steps < run->most_steps);
    struct end *end = points->ends + slot->point;
    if (!(going_on || spent || code == HORIZON || code == STOPPED)) {
        slot->filled = slot->finished, end->code = SET_ASIDE;
        return false;
    }
    end->transitions += run->transitions;
    keep_transitions(slot, points, slot->block + places_of_run(run).records, run->transitions);
    run->transitions = 0;
    if (!going_on)
        finish_point(points, slot, code);
    return going_on;
}

/* Slots, with the work space and the compiled modes of their runs. */
struct in_progress {
    struct slot *slots;
    int64_t count;
    struct points *points;
    const struct tables *tables;
    int64_t steps; /* taken in this call */
    struct work work[SLOTS];
    struct tables own[SLOTS];
};

/* Prepare the work space of a slot's run. */
static void prepare(struct in_progress *all, int64_t i)
{
    struct slot *slot = all->slots + i;
    all->own[i] = tables_of_point(all->tables, all->points, slot->point);
    all->work[i] = work_to_proceed((struct run *)slot->block, all->own + i);
}

/* Begin the run of the next point; false if the point is set aside. */
static bool start_next(struct in_progress *all, int64_t i)
{
    struct points *points = all->points;
    struct slot *slot = all->slots + i;
    int64_t point = slot->point = points->next++;
    struct run *run = (struct run *)slot->block;
    const struct run *template = (const struct run *)points->start;
    const struct tables own = tables_of_point(all->tables, points, point);
    int64_t *mode = mode_of_point(points, template, point);
    write_numbers(run, points->start, (const char *)(points->numbers + point * 2 * (2 + template->states)));
    if (*mode == SET_ASIDE || !enter_at_start(run, &own, mode, points->surfaces[point])) {
        points->ends[point].code = SET_ASIDE;
        return false;
    }
    for (int64_t k = 0; k < points->surface_count; k++)
        slot->pending[k * points->width] = 0.0;
    points->ends[point].transitions = 0;
    slot->running = 1, slot->finished = slot->filled;
    prepare(all, i);
    return true;
}

/* Run points in a slot until one reaches a step that is taken together with other slots, or until no point is left or
 * Python is needed (false); set the slot's code. */
static bool run_slot(struct in_progress *all, int64_t i)
{
    struct points *points = all->points;
    struct slot *slot = all->slots + i;
    struct run *run = (struct run *)slot->block;
    while (all->steps < points->steps) {
        if (slot->running == 0) {
            if (points->next >= points->count)
                return slot->code = DONE, true;
            if (!start_next(all, i))
                continue;
        }
        if (slot->filled + run->transition_capacity + points->surface_count > slot->capacity)
            return slot->code = BUFFER_FULL, false;
        int64_t before = run->steps, code = proceed(all->work + i);
        all->steps += run->steps - before;
        if (code == BEFORE_STEP)
            return slot->code = WAITING, true;
        if (!take_in(slot, points, code)) {
            slot->running = 0, slot->finished = slot->filled;
            if (points->stop_aside != 0 && points->ends[slot->point].code == SET_ASIDE)
                return slot->code = ASIDE, false;
        }
    }
    return slot->code = RUNNING, true;
}

/* Find the largest group of waiting slots whose modes have the same code, at most LANES; return its size. */
static int64_t largest_group(const struct in_progress *all, int64_t *group)
{
    int64_t most = 0;
    for (int64_t i = 0; i < all->count && most < LANES; i++) {
        int64_t found[LANES], size = 0;
        for (int64_t j = i; all->slots[i].code == WAITING && j < all->count && size < LANES; j++)
            if (all->slots[j].code == WAITING && all->work[j].mode->lanes == all->work[i].mode->lanes)
                found[size++] = j;
        if (size > most)
            memcpy(group, found, sizeof found), most = size;
    }
    return most;
}

/* Expand the runs of a group of slots at once; each slot then goes on with its own coefficients. The lanes of vectors
 * that are left over repeat the first run. */
static void expand_together(struct in_progress *all, const int64_t *group, int64_t size)
{
    double times[3 * LANES], *c[LANES];
    const double *x[LANES], *constants[LANES];
    for (int64_t k = 0; k < LANES; k++) {
        const struct work *w = all->work + group[k < size ? k : 0];
        times[k] = w->run->time, times[LANES + k] = w->run->time_low, times[2 * LANES + k] = w->run->unit;
        x[k] = w->x, constants[k] = w->constants, c[k] = w->c;
    }
    lower_range_flags();
    all->work[group[0]].mode->lanes(times, x, constants, c);
    int64_t stepping = raised_range_flags() == 0 ? FROM_LANES : ONCE_ALONE;
    for (int64_t k = 0; k < size; k++)
        all->work[group[k]].run->stepping = stepping;
}

/* Run the points until all are done or a slot needs Python; return the number of steps taken.
 *
 * tables: those of the first point, or of all points.
 */
HENON_EXPORT int64_t run_points(struct slot *slots, int64_t count, struct points *points, const struct tables *tables)
{
    struct in_progress all = {.slots = slots, .count = count, .points = points, .tables = tables};
    int64_t group[LANES], size;
    bool on = true; /* no slot needs Python */
    for (int64_t i = 0; i < count; i++) {
        if (slots[i].running)
            prepare(&all, i);
        on = run_slot(&all, i) && on;
    }
    while (on && all.steps < points->steps && (size = largest_group(&all, group)) > 0) {
        if (size > 1)
            expand_together(&all, group, size);
        else
            all.work[group[0]].run->stepping = ONCE_ALONE;
        for (int64_t k = 0; k < size; k++)
            on = run_slot(&all, group[k]) && on;
    }
    return all.steps;
}

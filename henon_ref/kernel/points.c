/* Runs of many points in one call, without Python or its interpreter lock.
 *
 * A point is set aside, by its number, if double precision cannot decide it, if it needs a mode that is not compiled,
 * or if its run ends before the horizon: Python finishes it (henon_ref/integrator/points.py).
 */

/* Place of the transition in a row of the buffer, in doubles: after the number of the point. */
#define KEPT_PLACE 1

static void append(struct progress *progress, const double *transition, const struct buffer *buffer)
{
    double *row = buffer->kept + progress->kept * buffer->width;
    memcpy(row, &progress->point, sizeof progress->point);
    memcpy(row + KEPT_PLACE, transition, (size_t)(buffer->width - KEPT_PLACE) * sizeof(double));
    progress->kept += 1;
}

/* Append transitions to the buffer, except those before progress->after.
 *
 * records: transitions of the present point. The buffer has room for "count" of them and one per surface.
 */
HENON_EXPORT void keep_transitions(struct progress *progress, const double *records, int64_t count,
                                   const struct buffer *buffer)
{
    for (int64_t k = 0; k < count; k++) {
        const double *record = records + k * (buffer->width - KEPT_PLACE);
        struct transition made;
        memcpy(&made, record, sizeof made);
        double *waiting = buffer->pending + made.surface * buffer->width;
        if (made.time < progress->after) {
            if (progress->open_sticks != 0 && (made.kind == STICK || made.kind == RELEASED)) {
                waiting[0] = made.kind == STICK ? 1.0 : 0.0;
                memcpy(waiting + KEPT_PLACE, record, (size_t)(buffer->width - KEPT_PLACE) * sizeof(double));
            }
            continue;
        }
        if (made.kind == RELEASED && waiting[0] != 0.0) {
            append(progress, waiting + KEPT_PLACE, buffer);
            waiting[0] = 0.0;
        }
        append(progress, record, buffer);
    }
}

/* Mode of a point: its row, or its words. */
static inline int64_t *mode_of_point(const struct points *points, const struct run *run, int64_t point)
{
    int64_t words = words_of(run->contacts);
    return points->rows + point * (words ? words : 1);
}

/* Start the run of a point; false if its mode is not clear. */
static bool begin_point(const struct points *points, const struct tables *tables, int64_t point)
{
    struct run *run = (struct run *)points->block;
    const struct run *template = (const struct run *)points->start;
    write_numbers(run, points->start, (const char *)(points->numbers + point * 2 * (2 + template->states)));
    return enter_at_start(run, tables, mode_of_point(points, template, point), points->surfaces[point]);
}

/* Store the end of a point's run. */
static void finish_point(const struct points *points, int64_t code, int64_t point)
{
    const struct run *run = (const struct run *)points->block;
    const struct places p = places_of_run(run);
    struct end *end = points->ends + point;
    end->time = run->time, end->time_low = run->time_low, end->code = code, end->mode = run->mode;
    end->steps = run->steps, end->expansions = run->expansions, end->guard_evaluations = run->guard_evaluations;
    memcpy(mode_of_point(points, run, point), points->block + p.entries,
           (size_t)words_of(run->contacts) * sizeof(double));
    memcpy(points->states + point * run->states, points->block + p.state, (size_t)run->states * sizeof(double));
}

/* Store the result of a call of the loop; return whether the point's run continues. */
static bool take_in(struct progress *progress, const struct points *points, int64_t code, const struct buffer *buffer)
{
    struct run *run = (struct run *)points->block;
    const struct places p = places_of_run(run);
    bool spent = code == BUDGET_SPENT, going_on = code == BLOCK_FULL || (spent && run->steps < run->most_steps);
    struct end *end = points->ends + progress->point;
    if (!(going_on || spent || code == HORIZON || code == STOPPED)) {
        progress->kept = progress->kept_before, end->code = SET_ASIDE;
        return false;
    }
    end->transitions += run->transitions;
    keep_transitions(progress, points->block + p.records, run->transitions, buffer);
    run->transitions = 0;
    if (!going_on)
        finish_point(points, code, progress->point);
    return going_on;
}

/* Begin the run of the next point; false if the point is set aside. */
static bool start_next(struct progress *progress, const struct points *points, const struct tables *tables,
                       const struct buffer *buffer)
{
    int64_t point = progress->point;
    if (*mode_of_point(points, (const struct run *)points->start, point) == SET_ASIDE || !begin_point(points, tables, point)) {
        points->ends[point].code = SET_ASIDE;
        return false;
    }
    for (int64_t i = 0; i < buffer->surfaces; i++)
        buffer->pending[i * buffer->width] = 0.0;
    points->ends[point].transitions = 0;
    progress->running = 1, progress->kept_before = progress->kept;
    return true;
}

/* Run the points until all are done, or Python is needed; return an enum points_code.
 *
 * tables: those of the first point, or of all points.
 */
HENON_EXPORT int64_t run_points(struct progress *progress, const struct points *points, const struct tables *tables,
                                const struct buffer *buffer)
{
    struct run *run = (struct run *)points->block;
    int64_t spent = 0;
    while (progress->point < points->count) {
        int64_t point = progress->point;
        struct tables own = *tables;
        own.numbers += point * points->numbers_step;
        own.selection.constants += own.selection.constants ? point * points->numbers_step : 0;
        if (progress->running == 0 && !start_next(progress, points, &own, buffer)) {
            progress->point += 1;
            continue;
        }
        if (progress->kept + run->transition_capacity + buffer->surfaces > buffer->capacity)
            return BUFFER_FULL;
        int64_t before = run->steps;
        int64_t code = advance(run, &own, NULL, 0);
        spent += run->steps - before;
        if (!take_in(progress, points, code, buffer)) {
            progress->running = 0;
            progress->point += 1;
            if (progress->stop_aside != 0 && points->ends[point].code == SET_ASIDE)
                return ASIDE;
        }
        if (spent > progress->steps)
            return PAUSE;
    }
    return DONE;
}

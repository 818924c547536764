/* Start of a run: its numbers in its block, and its mode, if that is clear: off all surfaces, or on one of them.
 *
 * A single run from Python (henon_ref/integrator/integrator.py) and each of many points (points.c) start here.
 */

/* Write a start's numbers into a run's block.
 *
 * template: begin of the block, the same for all such starts. numbers: pairs: horizon, initial time [s], states.
 */
static void write_numbers(struct run *run, const double *template, const char *numbers)
{
    double *block = (double *)run;
    const struct places p = places_of_run((const struct run *)template);
    const struct pair horizon = pair_in(numbers, 0), time = pair_in(numbers, 1);
    memcpy(block, template, (size_t)p.end_of_state * sizeof(double));
    run->time = run->begin = time.high, run->time_low = time.low;
    run->horizon = horizon.high, run->horizon_low = horizon.low;
    run->unit = larger(remaining(run), SHORTEST_UNIT);
    double *x = block + p.state, *x_low = x + run->states;
    for (int64_t i = 0; i < run->states; i++) {
        const struct pair state = pair_in(numbers, 2 + i);
        x[i] = state.high, x_low[i] = state.low;
    }
}

/* Enter the mode given by the signs, off all surfaces; false if a sign is zero or not clear, or the mode not compiled.
 *
 * signs: of the surfaces, then of the valid expressions.
 */
static bool enter_off_surfaces(struct work *w, const int64_t *signs, int64_t surfaces, int64_t count)
{
    int64_t number = 0, contacts = w->run->contacts;
    for (int64_t k = 0; k < count; k++)
        if (signs[k] != 1 && !(signs[k] == -1 && k < surfaces))
            return false;
    for (int64_t i = 0; i < contacts; i++)
        w->entries[i / ENTRIES_IN_WORD] |= (int64_t)((uint64_t)(signs[i] + 1) << bit_of(i));
    if (contacts)
        return w->tables->count == 3;
    if (surfaces > MOST_SURFACES)
        return false;
    for (int64_t i = surfaces - 1; i >= 0; i--)
        number = 3 * number + signs[i] + 1;
    int64_t row = row_of_number(w, number);
    w->run->mode = row < 0 ? 0 : row;
    return row >= 0;
}

/* Row of the mode that follows on a surface, UNCLEAR if that is not clear; the run is in the mode below the surface.
 *
 * The one mode of three whose own field keeps it (Filippov 1988, Sec. 2.10): both normal velocities point at the
 * surface, or both to one side. If they point away from it both slips are possible, which Python reports.
 *
 * zeros: filled with the known zeros with which the surface is left (0: the mode slides on it).
 */
static int64_t row_on_surface(struct work *w, int64_t surface, int64_t *zeros)
{
    const struct run *run = w->run;
    const double *constants = w->constants + w->tables->length;
    *zeros = 0;
    for (int64_t g = 0; g < w->mode->guards; g++) {
        const struct guard *guard = &w->mode->guard[g];
        if (!is_on(guard, surface))
            continue;
        w->mode->normal_velocities(run->time, 0.0, 1.0, w->x, constants, w->room);
        double below = w->room[run->states + 2 * g], above = w->room[run->states + 2 * g + 1];
        double margin = CLEAR_MARGIN * larger(fabs(below), fabs(above));
        if (below > margin && above < -margin)
            return guard->mode_stuck;
        if (below > margin && above > margin) {
            *zeros = 1;
            return guard->mode_across;
        }
        if (below < -margin && above < -margin) {
            *zeros = 1;
            return run->mode;
        }
        return UNCLEAR;
    }
    return UNCLEAR;
}

/* Enter a mode at a start; false if the mode that follows on a surface is not clear.
 *
 * mode: its row, or the words of its entries. surface: on which the start lies, -1 for none; "mode" is then the one
 * below the surface, and the mode that follows is entered.
 */
HENON_EXPORT int64_t enter_at_start(struct run *run, const struct tables *tables, const int64_t *mode, int64_t surface)
{
    int64_t words = words_of(run->contacts), zeros;
    memcpy((double *)run + places_of_run(run).entries, mode, (size_t)words * sizeof(double));
    run->mode = words ? 0 : mode[0];
    if (surface < 0)
        return true;
    struct work work = work_of(run, tables);
    put_together(&work);
    int64_t row = row_on_surface(&work, surface, &zeros);
    if (row < 0)
        return false;
    go_over(&work, surface, row);
    set_known_zeros(&work, work.mode, surface, zeros);
    return true;
}

/* Start a run: write its numbers into its block, and enter its mode if the start is clearly off all surfaces.
 *
 * program: of the surfaces, then of the valid expressions, in time, states and parameters. numbers: pairs: horizon,
 * then the program's inputs. room: for the signs of the expressions, which are filled in, and the program's registers.
 * Returns whether a mode was entered.
 */
HENON_EXPORT int64_t start_run(struct run *run, const double *template, const struct tables *tables,
                               const struct program *program, int64_t surfaces, const char *numbers, double *room)
{
    write_numbers(run, template, numbers);
    if (!program)
        return false;
    int64_t *signs = (int64_t *)room;
    double *registers = room + program->results;
    run_at(program, numbers + sizeof(struct pair), (struct bounded *)registers);
    signs_of(registers, program->width, 1, program->outputs, program->results, signs);
    struct work work = work_of(run, tables);
    return enter_off_surfaces(&work, signs, surfaces, program->results);
}

/* The mode at a start that lies on one surface, from the normal velocities on both sides where these are clear. */

/* Row of the mode that follows at a start on a surface, that of the mode below it being given; see mode_on_surface. */
static int64_t row_on_surface(const struct mode *mode, const double *constants, int64_t row, int64_t surface, double t,
                              const double *x, int64_t states, double *speeds, int64_t *zeros)
{
    *zeros = 0;
    for (int64_t g = 0; g < mode->guards; g++) {
        const struct guard *guard = &mode->guard[g];
        if (!is_on(guard, surface))
            continue;
        mode->normal_velocities(t, 0.0, 1.0, x, constants, speeds);
        double below = speeds[states + 2 * g], above = speeds[states + 2 * g + 1];
        double margin = CLEAR_MARGIN * larger(fabs(below), fabs(above));
        if (below > margin && above < -margin)
            return guard->mode_stuck;
        if (below > margin && above > margin) {
            *zeros = 1;
            return guard->mode_across;
        }
        if (below < -margin && above < -margin) {
            *zeros = 1;
            return row;
        }
        return UNCLEAR;
    }
    return UNCLEAR;
}

/* Row of the mode that follows, UNCLEAR where that is not clear; and the zeros with which its surface is left (0: it
 * slides).
 *
 * The one mode of three whose own field keeps it (Filippov 1988, Sec. 2.10): both normal velocities point at the
 * surface, or both to one side. Where they point away from it both slips do, and Python says so.
 *
 * row: of the mode below the surface, where its sign is -1. t, x: the start, of a number of states. guards: of the
 * largest mode. speeds: work space, states and twice the guards.
 */
HENON_EXPORT int64_t mode_on_surface(const struct tables *tables, int64_t row, int64_t surface, double t,
                                     const double *x, int64_t states, int64_t guards, double *speeds, int64_t *zeros)
{
    const double *constants = constants_of(tables, row, 1);
    return row_on_surface(mode_in(tables, row, guards), constants, row, surface, t, x, states, speeds, zeros);
}

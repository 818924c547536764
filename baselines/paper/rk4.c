/* Runge-Kutta method of order 4 with a fixed step in one mode, up to the step that crosses a guard: henon-rk4. */

/* One classical Runge-Kutta step. The time is a state, so that the forcing is evaluated at the stage times. */
HENON_EXPORT void rk4_step(const struct rk4_mode *mode, double *room, double t, const double *x, double h, double *out)
{
    const int64_t n = mode->states;
    double *const rates = room + n, *const total = room + 2 * n; /* the field's code copies x into room */
    mode->field(t, 0.0, 1.0, x, mode->field_constants, room);
    for (int64_t i = 0; i < n; i++) {
        total[i] = rates[i];
        out[i] = x[i] + h / 2 * rates[i];
    }
    for (int stage = 0; stage < 2; stage++) {
        mode->field(t + h / 2, 0.0, 1.0, out, mode->field_constants, room);
        for (int64_t i = 0; i < n; i++) {
            total[i] += 2 * rates[i];
            out[i] = x[i] + (stage == 0 ? h / 2 : h) * rates[i];
        }
    }
    mode->field(t + h, 0.0, 1.0, out, mode->field_constants, room);
    for (int64_t i = 0; i < n; i++)
        out[i] = x[i] + h / 6 * (total[i] + rates[i]);
}

HENON_EXPORT void rk4_guards(const struct rk4_mode *mode, double t, const double *x, double *out)
{
    mode->guard(t, 0.0, 1.0, x, mode->guard_constants, out);
}

static bool is_through(double g, bool armed, bool rising_only)
{
    return (g < 0 && (armed || !rising_only)) || (g == 0 && armed);
}

/* The time is computed from `base` and the number of steps, so that rounding does not accumulate. */
HENON_EXPORT int64_t rk4_advance(const struct rk4_mode *mode, struct rk4_steps *s)
{
    const int64_t n = mode->states, m = mode->guards;
    double *const g = s->room + 4 * n; /* after the work space of a step and the guards' copy of x */
    for (; s->first < s->last; s->first++) {
        const double t = s->base + (double)s->first * s->h, after = s->base + (double)(s->first + 1) * s->h;
        rk4_step(mode, s->room, t, s->x, s->h, s->new_state);
        for (int64_t i = 0; i < n; i++)
            if (!isfinite(s->new_state[i]))
                return RK4_NOT_FINITE;
        rk4_guards(mode, after, s->new_state, s->room + 3 * n);
        for (int64_t i = 0; i < m; i++)
            if (is_through(g[i], s->armed[i], mode->rising_only[i]))
                return RK4_EVENT;
        for (int64_t i = 0; i < m; i++)
            if (isnan(g[i]))
                return RK4_NO_GUARD;
        for (; s->filled < s->count && s->wanted[s->filled] <= after; s->filled++)
            rk4_step(mode, s->room, t, s->x, s->wanted[s->filled] - t, s->samples + s->filled * n);
        for (int64_t i = 0; i < m; i++)
            s->armed[i] = s->armed[i] || g[i] > 0;
        for (int64_t i = 0; i < n; i++)
            s->x[i] = s->new_state[i];
    }
    return RK4_DONE;
}

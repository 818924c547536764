/* The paper's program with a switch for each of its mistakes, for the audit (henon_ref.harness.studies.paper.audit).

   With all switches off it is a correct implementation of Sec. 3 for Eq. (18): order 4, Filippov's sliding. With all
   switches on it gives exactly the numbers of the appendix as printed (listing.c). */

/* Runge-Kutta step in time. With aliasing `old` moves with every stage. */
static void variant_slip_step(struct belt_state *x, const struct belt *belt, const struct spring *s, double h,
                              double side_constant, bool aliased, bool frozen)
{
    const struct belt_state copy = *x, *const old = aliased ? x : &copy;
    const double start = base_position(belt, x->time);
    const double middle = frozen ? start : base_position(belt, x->time + h / 2);
    const double end = frozen ? start : base_position(belt, x->time + h);
    const double v1 = x->velocity, a1 = acceleration(s, x->position, x->velocity, start, side_constant);
    x->position = old->position + h / 2 * v1;
    x->velocity = old->velocity + h / 2 * a1;
    const double v2 = x->velocity, a2 = acceleration(s, x->position, x->velocity, middle, side_constant);
    x->position = old->position + h / 2 * v2;
    x->velocity = old->velocity + h / 2 * a2;
    const double v3 = x->velocity, a3 = acceleration(s, x->position, x->velocity, middle, side_constant);
    x->position = old->position + h * v3;
    x->velocity = old->velocity + h * a3;
    const double v4 = x->velocity, a4 = acceleration(s, x->position, x->velocity, end, side_constant);
    x->position = old->position + h / 6 * (v1 + 2 * (v2 + v3) + v4);
    x->velocity = old->velocity + h / 6 * (a1 + 2 * (a2 + a3) + a4);
}

/* Eq. (14): Runge-Kutta step with the velocity as independent variable; it also advances the time. */
static void variant_landing_step(struct belt_state *x, const struct belt *belt, const struct spring *s, double length,
                                 double side_constant, bool aliased, bool frozen, double sixth)
{
    const struct belt_state copy = *x, *const old = aliased ? x : &copy;
    const double half = length * 0.5, t = x->time, start = base_position(belt, t);
    const double t1 = 1 / acceleration(s, x->position, x->velocity, start, side_constant), p1 = x->velocity * t1;
    x->position = old->position + half * p1;
    x->velocity = old->velocity + half;
    double base = frozen ? start : base_position(belt, t + half * t1);
    const double t2 = 1 / acceleration(s, x->position, x->velocity, base, side_constant), p2 = x->velocity * t2;
    x->position = old->position + half * p2;
    base = frozen ? start : base_position(belt, t + half * t2);
    const double t3 = 1 / acceleration(s, x->position, x->velocity, base, side_constant), p3 = x->velocity * t3;
    x->position = old->position + length * p3;
    x->velocity = old->velocity + length;
    base = frozen ? start : base_position(belt, t + length * t3);
    const double t4 = 1 / acceleration(s, x->position, x->velocity, base, side_constant), p4 = x->velocity * t4;
    x->position = old->position + sixth * length * (p1 + 2 * (p2 + p3) + p4);
    x->time = t + sixth * length * (t1 + 2 * (t2 + t3) + t4);
}

/* Time in (t, t + h] at which z reaches `edge` in stick, the solution of Eq. (15), by bisection. */
static double release_time(const struct belt_state *x, const struct belt *belt, double h, double edge)
{
    const double t = x->time, vp = belt->vp;
    const bool falls = x->position + vp * h - base_position(belt, t + h) < edge;
    double low = 0.0, high = h;
    for (int k = 0; k < 60; k++) {
        const double middle = 0.5 * (low + high);
        const double inside = x->position + vp * middle - base_position(belt, t + middle);
        if (falls ? inside > edge : inside < edge)
            low = middle;
        else
            high = middle;
    }
    return t + high;
}

/* Take a step in stick; return whether the stick continues. At its end `side` is the side that the state enters. */
static bool stick_step(struct belt_state *x, const struct belt *belt, double h, const double *edges, int64_t upper,
                       const struct defects *d, int64_t *side)
{
    const double after = x->position + h * belt->vp, base = base_position(belt, x->time + h);
    double edge = edge_at(edges, upper);
    bool out = after >= edge + base;
    if (!out && !d->one_sided_release && after <= edge_at(edges, upper + 1) + base) {
        out = true;
        edge = edge_at(edges, upper + 1);
    }
    if (!out) {
        x->position = after;
        x->time = x->time + h;
        return true;
    }
    if (d->quantised_release) {
        x->position = edge + base;
        x->time = x->time + h;
    } else if (d->frozen_tangent) {
        x->time = x->time + (edge + base - x->position) / belt->vp;
        x->position = edge + base;
    } else {
        const double at = release_time(x, belt, h, edge);
        x->position = x->position + belt->vp * (at - x->time);
        x->time = at;
    }
    const int64_t right = spring_force(belt->k1, belt->k2, edge) > 0 ? 1 : -1;
    *side = d->exit_side ? -right : right;
    return false;
}

/* Take a step in slip; return whether the state has landed on the belt's speed. */
static bool slip_or_land(struct belt_state *x, const struct belt *belt, const struct spring *s, double h, int64_t side,
                         const struct defects *d)
{
    const struct belt_state before = *x;
    const double vp = belt->vp, side_constant = side == -1 ? vp + 1 : vp - 1;
    variant_slip_step(x, belt, s, h, side_constant, d->aliased_steps, d->frozen_forcing);
    if (!(side == -1 ? x->velocity >= vp : x->velocity <= vp)) {
        x->time = x->time + h;
        return false;
    }
    if (!d->aliased_steps)
        *x = before;
    double length = vp - x->velocity;
    if (d->landing_sign && side == 1)
        length = -length;
    if (length != 0)
        variant_landing_step(x, belt, s, length, side_constant, d->aliased_steps, d->frozen_forcing,
                             d->rounded_sixth ? 0.166666 : 1.0 / 6);
    x->velocity = vp;
    return true;
}

HENON_EXPORT struct variant_end variant_run(struct belt_state *x, int64_t sticking, double until, double h,
                                            const double *edges, const struct belt *belt, const struct defects *defects,
                                            struct mode_change *changes, int64_t changes_room, struct belt_state *path,
                                            int64_t path_room, double path_from)
{
    const struct spring s = {1 / belt->m, belt->k1, belt->k2, belt->mu0};
    struct variant_end end = {0, 0, VARIANT_DONE};
    int64_t side = x->velocity < belt->vp ? -1 : 1;
    int64_t upper = zone(x->position, edges, base_position(belt, x->time));
    for (int64_t step = 0; x->time < until && end.changes < changes_room; step++) {
        const int64_t mode = sticking ? 0 : side;
        if (sticking) {
            sticking = stick_step(x, belt, h, edges, upper, defects, &side);
        } else if (slip_or_land(x, belt, &s, h, side, defects)) {
            const double base = base_position(belt, x->time);
            const double force = spring_force(belt->k1, belt->k2, x->position - base);
            if (force * force - belt->mu0 * belt->mu0 <= 0) {
                upper = zone(x->position, edges, base);
                sticking = true;
            } else {
                side = -side;
            }
        }
        if (!isfinite(x->position)) {
            end.ending = VARIANT_NOT_FINITE;
            return end;
        }
        const int64_t now = sticking ? 0 : side;
        if (now != mode)
            changes[end.changes++] = (struct mode_change){(double)step, x->time, x->position, x->velocity, (double)now};
        if (x->time >= path_from && end.path < path_room)
            path[end.path++] = *x;
    }
    end.ending = end.changes == changes_room ? VARIANT_CHATTERS : VARIANT_DONE;
    return end;
}

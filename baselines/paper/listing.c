/* The program of the paper's appendix, Olejnik and Awrejcewicz (2013), Listing 1, which produced Fig. 8, with a switch
   for each of its mistakes.

   With all switches on it is the appendix as printed, henon-listing. With all switches off it is a correct
   implementation of Sec. 3 for Eq. (18): order 4, Filippov's sliding. The audit (henon_ref.harness.studies.paper.audit)
   runs what is between.

   The most important mistake (aliased_steps): in Python `xn = x` gives the same list two names. The listing overwrites
   the old state whenever it writes the new one, so that each Runge-Kutta stage starts at the end of the stage before. A
   step of length h moves the slip state by (1/2 + 1/2 + 1 + 1) h = 3 h, while time, forcing and stick move by h.
   Therefore the limit for h -> 0 has the slip field 3 f.

   Mistakes without an effect on Fig. 8 have no switch: the printed loop never advances its counter (this one does), and
   a start in the third stick zone is not tested (listing.py). */

/* Runge-Kutta step in time. With aliasing `old` moves with every stage; frozen, all four stages use the forcing of the
   start of the step (order 1 in h). The caller advances the time. */
static void slip_step(struct belt_state *x, const struct belt *belt, const struct spring *s, double h,
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

/* Eq. (14): Runge-Kutta step with the velocity as independent variable. It also advances the time, which it writes
   once, at its end: the time is right even with aliasing. */
static void landing_step(struct belt_state *x, const struct belt *belt, const struct spring *s, double length,
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

/* Take a step in stick; return whether the stick continues. At its end `side` is the side that the state enters.
   Mistakes: only the upper tangent point is tested, although z may also leave the zone at its lower end; the way back
   to the tangent point is that of the step's end (and, aliased, the new minus the old position, which are the same
   number: the time stays at the end of the step). By the printed sign of the spring, the middle zone (2) must be left
   downwards at its upper end, the other zones upwards; the listing does the opposite, and the next step undoes it. */
static bool stick_step(struct belt_state *x, const struct belt *belt, double h, const double *edges, int64_t upper,
                       const struct defects *d, int64_t *side)
{
    const double after = x->position + h * belt->vp, base = base_position(belt, x->time + h);
    const bool above = after >= edge_at(edges, upper) + base;
    const bool below = !above && !d->one_sided_release && after <= edge_at(edges, upper + 1) + base;
    const double edge = edge_at(edges, below ? upper + 1 : upper);
    if (!above && !below) {
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
    if (d->exit_side)
        *side = (upper != 2) == above ? -1 : 1;
    else
        *side = spring_force(belt->k1, belt->k2, edge) > 0 ? 1 : -1;
    return false;
}

/* Take a step in slip; return whether the state has landed on the belt's speed.
   Mistakes: aliasing has overwritten the old velocity, so that `length` is the distance from the new velocity back to
   the belt's, which has the wrong sign from above; 0.166666 is used for 1/6. */
static bool slip_or_land(struct belt_state *x, const struct belt *belt, const struct spring *s, double h, int64_t side,
                         const struct defects *d)
{
    const struct belt_state before = *x;
    const double vp = belt->vp, side_constant = side == -1 ? vp + 1 : vp - 1;
    slip_step(x, belt, s, h, side_constant, d->aliased_steps, d->frozen_forcing);
    if (!(side == -1 ? x->velocity >= vp : x->velocity <= vp)) {
        x->time = x->time + h;
        return false;
    }
    if (!d->aliased_steps)
        *x = before;
    double length = vp - x->velocity;
    if (d->landing_sign && side != -1)
        length = -length;
    if (length != 0)
        landing_step(x, belt, s, length, side_constant, d->aliased_steps, d->frozen_forcing,
                     d->rounded_sixth ? 0.166666 : 1.0 / 6);
    x->velocity = vp;
    return true;
}

HENON_EXPORT struct listing_end listing_run(struct belt_state *x, int64_t sticking, int64_t passes, double until,
                                            double h, const double *edges, const struct belt *belt,
                                            const struct defects *defects, struct mode_change *changes,
                                            int64_t changes_room, struct belt_state *path, int64_t path_room,
                                            double path_from)
{
    const struct spring s = {1 / belt->m, belt->k1, belt->k2, belt->mu0};
    struct listing_end end = {0, 0, 0, 0, 0};
    int64_t side = (x->velocity > belt->vp) - (x->velocity < belt->vp);
    int64_t upper = zone(x->position, edges, base_position(belt, x->time));
    for (int64_t pass = 0; pass < passes && x->time < until && end.changes < changes_room; pass++) {
        const int64_t mode = sticking ? 0 : side;
        if (sticking) {
            sticking = stick_step(x, belt, h, edges, upper, defects, &side);
        } else {
            end.slips++;
            if (slip_or_land(x, belt, &s, h, side, defects)) {
                end.landings++;
                const double base = base_position(belt, x->time);
                const double force = spring_force(belt->k1, belt->k2, x->position - base);
                if (force * force - belt->mu0 * belt->mu0 <= 0) {
                    upper = zone(x->position, edges, base);
                    sticking = true;
                } else {
                    side = -side;
                }
            }
        }
        end.mode = sticking ? 0 : side;
        if (end.mode != mode)
            changes[end.changes++] =
                (struct mode_change){(double)pass, x->time, x->position, x->velocity, (double)end.mode};
        if (x->time >= path_from && end.path < path_room)
            path[end.path++] = *x;
    }
    return end;
}

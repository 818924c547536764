/* The program of the paper's appendix as printed, including its mistakes: henon-listing.

   Olejnik and Awrejcewicz (2013), Listing 1, which produced Fig. 8. Comments mark each mistake at its line; variants.c
   has a switch for each mistake.

   The most important mistake: in Python `xn = x` gives the same list two names. The listing overwrites the old state
   whenever it writes the new one, so that each Runge-Kutta stage starts at the end of the stage before. A step of
   length h moves the slip state by (1/2 + 1/2 + 1 + 1) h = 3 h, while time, forcing and stick move by h. Therefore the
   limit for h -> 0 has the slip field 3 f. */

/* The Runge-Kutta step in time, on the one list that is both old and new state.
   Defects: every stage moves the state itself (3 h in total); all four stages use the forcing `base` of the start of
   the step (order 1 in h). The caller advances the time. */
static void slip_step(struct belt_state *x, const struct spring *s, double base, double h, double side_constant)
{
    const double v1 = x->velocity, a1 = acceleration(s, x->position, x->velocity, base, side_constant);
    x->position = x->position + h / 2 * v1;
    x->velocity = x->velocity + h / 2 * a1;
    const double v2 = x->velocity, a2 = acceleration(s, x->position, x->velocity, base, side_constant);
    x->position = x->position + h / 2 * v2;
    x->velocity = x->velocity + h / 2 * a2;
    const double v3 = x->velocity, a3 = acceleration(s, x->position, x->velocity, base, side_constant);
    x->position = x->position + h * v3;
    x->velocity = x->velocity + h * a3;
    const double v4 = x->velocity, a4 = acceleration(s, x->position, x->velocity, base, side_constant);
    x->position = x->position + h / 6 * (v1 + 2 * (v2 + v3) + v4);
    x->velocity = x->velocity + h / 6 * (a1 + 2 * (a2 + a3) + a4);
}

/* The swapped step of Eq. (14), with the velocity as independent variable; again on the one list.
   Defects: as in slip_step, and 0.166666 is used for 1/6. The time is correct, because it is written once, at the
   end. */
static void landing_step(struct belt_state *x, const struct spring *s, double base, double length, double side_constant)
{
    const double half = length * 0.5, sixth = length * 0.166666;
    const double t1 = 1 / acceleration(s, x->position, x->velocity, base, side_constant), p1 = x->velocity * t1;
    x->position = x->position + half * p1;
    x->velocity = x->velocity + half;
    const double t2 = 1 / acceleration(s, x->position, x->velocity, base, side_constant), p2 = x->velocity * t2;
    x->position = x->position + half * p2;
    const double t3 = 1 / acceleration(s, x->position, x->velocity, base, side_constant), p3 = x->velocity * t3;
    x->position = x->position + length * p3;
    x->velocity = x->velocity + length;
    const double t4 = 1 / acceleration(s, x->position, x->velocity, base, side_constant), p4 = x->velocity * t4;
    x->position = x->position + sixth * (p1 + 2 * (p2 + p3) + p4);
    x->time = x->time + sixth * (t1 + 2 * (t2 + t3) + t4);
}

/* The main loop. (The printed loop never advances its counter; this one does.) */
HENON_EXPORT struct listing_end listing_run(struct belt_state *x, const double *edges, double h, int64_t passes,
                                            const struct belt *belt, struct mode_change *changes, int64_t changes_room,
                                            struct belt_state *path, int64_t path_room)
{
    const double vp = belt->vp;
    const struct spring s = {1 / belt->m, belt->k1, belt->k2, belt->mu0};
    struct listing_end end = {0, 0, 0, 0};
    bool sticking = false;
    int64_t side = 0;
    if (x->velocity == vp) {
        /* A defect without effect here: the third stick zone is not tested. */
        for (int64_t upper = 0; upper <= 2; upper += 2)
            if (edges[upper + 1] <= x->position && x->position <= edges[upper])
                sticking = true;
    } else {
        side = x->velocity < vp ? -1 : 1;
    }
    double base = base_position(belt, x->time);
    int64_t upper = zone(x->position, edges, base);
    for (int64_t pass = 0; pass < passes; pass++) {
        const int64_t mode = sticking ? 0 : side;
        if (sticking) {
            x->position = x->position + h * x->velocity;
            x->time = x->time + h;
            base = base_position(belt, x->time);
            /* Defect: only the upper tangent point is tested; z may also leave the zone at its lower end. */
            if (!(x->position < edge_at(edges, upper) + base)) {
                sticking = false;
                /* Defect: the distance back to the tangent point is the new minus the old position. Both are the same
                   number, so that the distance is 0 and the time stays at the end of the step. */
                x->position = edge_at(edges, upper) + base;
                /* Defect: by the printed sign of the spring, the middle zone (2) must be left downwards and the other
                   zones upwards. The listing does the opposite; the next step undoes it. */
                side = upper != 2 ? -1 : 1;
            }
        } else {
            const double side_constant = side == -1 ? vp + 1 : vp - 1;
            end.slips++;
            slip_step(x, &s, base, h, side_constant);
            if (side == -1 ? x->velocity >= vp : x->velocity <= vp) {
                /* Aliasing has overwritten the old velocity, so that this is the distance from the new velocity back
                   to the belt's. Defect: from above it has the wrong sign. */
                const double length = side == -1 ? vp - x->velocity : x->velocity - vp;
                end.landings++;
                landing_step(x, &s, base, length, side_constant);
                x->velocity = vp;
                base = base_position(belt, x->time);
                const double force = spring_force(belt->k1, belt->k2, x->position - base);
                if (force * force - belt->mu0 * belt->mu0 <= 0) {
                    upper = zone(x->position, edges, base);
                    sticking = true;
                } else {
                    side = -side;
                }
            } else {
                x->time = x->time + h;
                base = base_position(belt, x->time);
            }
        }
        end.mode = sticking ? 0 : side;
        if (end.mode != mode && end.changes < changes_room)
            changes[end.changes++] =
                (struct mode_change){(double)pass, x->time, x->position, x->velocity, (double)end.mode};
        if (pass < path_room)
            path[pass] = *x;
    }
    return end;
}

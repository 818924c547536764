/* The oscillator of Fig. 8, Eq. (18), as the appendix computes it. Olejnik and Awrejcewicz (2013). */

/* Parameters that a step reads. */
struct spring {
    double inverse_mass, k1, k2, mu0;
};

/* Displacement of the far end of the spring. */
static double base_position(const struct belt *p, double t)
{
    return p->A * sin(p->w * t);
}

/* Force of the spring, -k1 z + k2 z^3. */
static double spring_force(double k1, double k2, double z)
{
    return -k1 * z + k2 * (z * (z * z));
}

/* x2' of Eq. (18); `side_constant` is vp + 1 below the belt's speed and vp - 1 above it. */
static double acceleration(const struct spring *s, double position, double velocity, double base, double side_constant)
{
    return s->inverse_mass * (spring_force(s->k1, s->k2, position - base) + s->mu0 / (side_constant - velocity));
}

/* Index of the upper edge of the stick zone that contains the position; -1 outside all zones. */
static int64_t zone(double position, const double *edges, double base)
{
    for (int64_t upper = 4; upper >= 0; upper -= 2)
        if (position <= edges[upper] + base)
            return position >= edges[upper + 1] + base ? upper : -1;
    return -1;
}

/* An edge of the stick zones. For a negative index the appendix uses Python's edges[-1], which is the last edge. */
static double edge_at(const double *edges, int64_t index)
{
    return edges[index < 0 ? index + 6 : index];
}

/* The time of a run: a double and the rest that rounding has lost of it (a compensated sum). */

/* t += step as a compensated sum (Neumaier), so that late times lose no digits of a duration. */
static inline void add_to_time(struct run *run, double step)
{
    double t = run->time, total = t + step, part = total - t;
    double lost = (t - (total - part)) + (step - part);
    double low = run->time_low + lost;
    run->time = total + low;
    run->time_low = low - (run->time - total);
}

/* Time after a step from the present time. */
static inline struct pair time_after(const struct run *run, double step)
{
    struct pair total = pair_sum(run->time, step);
    return (struct pair){total.high, total.low + run->time_low};
}

/* Check whether a step is too short to move a double's time. */
static inline bool below_time_resolution(const struct run *run, double step)
{
    return step <= 0.25 * EPS * fabs(run->time);
}

/* Check whether a step is too short even to move the compensated time. */
static inline bool below_compensated_resolution(const struct run *run, double step)
{
    return step <= 0.25 * EPS * EPS * fabs(run->time);
}

/* Time left up to the horizon. */
static inline double remaining(const struct run *run)
{
    return (run->horizon - run->time) + (run->horizon_low - run->time_low);
}

/* Longest duration of all later impacts that is replaced by rest [s]. */
static inline double longest_rest(const struct run *run)
{
    return run->rest_part * (run->horizon - run->begin);
}

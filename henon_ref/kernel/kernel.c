/* The compiled part of the reference, as one translation unit, so that small functions are inlined everywhere.
 *
 * A file is included before the files that use it; docs/how_it_works.md names the files in the order of a run.
 * henon_ref/kernel/kernel.h declares what Python calls.
 */
#include "kernel.h"
#include "self_test.h"

#include "numbers.h"
#include "work.h"

#include "roots.c"
#include "landing.c"
#include "double_double.c"
#include "pair_functions.c"
#include "pair_series.c"

#include "compensated_time.c"
#include "step_size.c"
#include "tail.c"
#include "validation.c"
#include "contacts.c"
#include "recorder.c"
#include "range.c"
#include "step.c"
#include "events.c"
#include "below_rounding.c"
#include "candidates.c"
#include "selection.c"
#include "contact_problem.c"
#include "contact_group.c"
#include "jump.c"
#include "transition.c"
#include "crossed_kinks.c"
#include "contact_events.c"
#include "near_zero.c"
#include "close_event.c"
#include "loop.c"
#include "start.c"
#include "points.c"
#include "parts.c"

/* Bounds and levels that Python reads, too. */
HENON_EXPORT struct levels levels(void)
{
    return (struct levels){
        .eps = EPS,
        .blown_up = BLOWN_UP,
        .state_rounding = STATE_ROUNDING,
        .known_zero_level = KNOWN_ZERO_LEVEL,
        .operation_error = OPERATION_ERROR,
        .accurate = ACCURATE,
        .clearance = CLEARANCE,
        .no_account = NO_ACCOUNT,
        .equal_part = EQUAL_PART,
        .held_tolerances = HELD_TOLERANCES,
    };
}

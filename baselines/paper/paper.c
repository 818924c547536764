/* Translation unit of the paper's programs; paper.h declares them. */
#include "paper.h"
#include "../../henon_ref/kernel/self_test.h"

#include <math.h>
#include <stdbool.h>

#include "belt.c"
#include "listing.c"
#include "rk4.c"

#define TEXT(number) TEXT_OF(number)
#define TEXT_OF(number) #number
#define VERSION(major, minor, patch) TEXT(major) "." TEXT(minor) "." TEXT(patch)

HENON_EXPORT const char *paper_compiler(void)
{
#if defined(__clang__)
    return "clang " VERSION(__clang_major__, __clang_minor__, __clang_patchlevel__);
#else
    return "gcc " VERSION(__GNUC__, __GNUC_MINOR__, __GNUC_PATCHLEVEL__);
#endif
}

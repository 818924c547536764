/* The one translation unit of the kernel: what it includes is static and can be inlined. */
#include "kernel.h"
#include "self_test.h"

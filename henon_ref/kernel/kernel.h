/* The compiled side of the reference: every structure, enumeration and exported function, for C and for Python alike
   (henon_ref/kernel/library.py gives it to cffi without its preprocessor's lines: declarations only, and constants as
   enumerations or as #define of one integer). */
#ifndef HENON_KERNEL_H
#define HENON_KERNEL_H

#include <stdint.h>

#define HENON_EXPORT __attribute__((visibility("default")))

#endif

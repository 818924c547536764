"""Worker processes: their start, their use of memory and processor time, and the machine that they run on."""

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of workers, one thread each: threads of linear algebra would compete with other workers."""

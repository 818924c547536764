"""Worker processes: their start, their use of memory and processor time, and the machine that they run on."""

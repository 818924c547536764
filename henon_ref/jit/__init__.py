"""Machine code of modes: LLVM IR, its compilation, the cache, the target processor."""

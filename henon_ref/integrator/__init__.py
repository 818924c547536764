"""The reference integrator: a Taylor method with Hénon's landing, compiled, mode loop and all."""

"""Many runs of one system: points, chunks of them, executors, observations, results on disk."""

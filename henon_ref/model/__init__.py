"""What is simulated: expressions, effects, scenes, Filippov systems, case files."""
